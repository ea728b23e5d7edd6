# Copyright 2026 stereo_refine_ros contributors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Disjoint sets as free functions on arrays, callable from numba kernels."""

from __future__ import annotations

from numba import njit
import numpy as np
from numpy.typing import NDArray

IndexArray = NDArray[np.int32]


def make_sets(count: int) -> tuple[IndexArray, IndexArray]:
    """
    Make `count` sets of one element each.

    Returns
    -------
    parent : int32 ndarray of shape (count,)
        The parent of every element; a root is its own parent.
    size : int32 ndarray of shape (count,)
        The number of elements below a root (stale for other elements).

    """
    return np.arange(count, dtype=np.int32), np.ones(count, np.int32)


@njit(cache=True, nogil=True)
def find(parent: IndexArray, node: int) -> int:
    """Return the root of `node`, shortening the path to it on the way."""
    # Two steps without asking: a root is its own parent, and few paths are longer. A loop from
    # the node on would end at a step that the processor cannot foresee.
    root = parent[parent[node]]
    while parent[root] != root:
        root = parent[parent[root]]
    parent[node] = root
    return root


@njit(cache=True, nogil=True)
def union(parent: IndexArray, size: IndexArray, root_a: int, root_b: int) -> int:
    """Join the sets of two different roots, the smaller under the larger; return the root."""
    if size[root_a] < size[root_b]:
        root_a, root_b = root_b, root_a
    parent[root_b] = root_a
    size[root_a] += size[root_b]
    return root_a

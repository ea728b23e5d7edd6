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

"""Matched regions that are too small to be anything but chance."""

from __future__ import annotations

from numba import njit
import numpy as np

from stereo_refine_ros.graph.disjoint_set import find, union
from stereo_refine_ros.matching.scratch import scratch
from stereo_refine_ros.matching.tuning import ISLANDS
from stereo_refine_ros.types import FloatMap

# Of a pixel; by as many a region's disparity may change from a pixel to the next.
_EIGHTHS = 8
_NONE = -(1 << 30)


def without_islands(disparity: FloatMap) -> FloatMap:
    """
    Drop matched regions of like disparity that are smaller than a part in ISLANDS.

    Parameters
    ----------
    disparity : float32 ndarray of shape (H, W)
        NaN where nothing matched. Neighbours belong together that differ by less than a pixel.

    Returns
    -------
    float32 ndarray of shape (H, W)

    """
    height, width = disparity.shape
    out = np.empty_like(disparity)
    with scratch(12 * disparity.size) as memory:
        run, size, parent = memory.view(np.int32).reshape(3, height * width)
        _island_kernel(disparity, run.reshape(height, width), size, parent,
                       disparity.size // ISLANDS, out)
    return out


@njit(cache=True, nogil=True)
def _island_kernel(disparity, run, size, parent, smallest, out):
    """Join runs of rows that touch; size, parent: one entry a run."""
    height, width = disparity.shape
    steps = np.empty((2, width), np.int32)
    count = 0
    for y in range(height):
        here, above = steps[y & 1], steps[1 - (y & 1)]
        row = disparity[y]
        for x in range(width):
            here[x] = _NONE if np.isnan(row[x]) else np.int32(row[x] * np.float32(_EIGHTHS))
        count = _runs(here, run[y], size, parent, count)
        if y > 0:
            _join(here, above, run[y], run[y - 1], size, parent)
    for i in range(count):
        size[i] = size[find(parent, i)]
    for y in range(height):
        row, to, ids = disparity[y], out[y], run[y]
        for x in range(width):
            to[x] = row[x] if size[ids[x]] > smallest else np.float32(np.nan)


@njit(cache=True, nogil=True)
def _runs(here, run, size, parent, count):
    """Give the runs of a row, unmatched ones too, the numbers from `count` on."""
    last = np.int32(0)
    begin = 0
    for x in range(here.shape[0]):
        if abs(here[x] - last) > _EIGHTHS or x == 0:
            if x > 0:
                size[count - 1] = x - begin
            parent[count] = count
            begin = x
            count += 1
        run[x] = count - 1
        last = here[x]
    size[count - 1] = here.shape[0] - begin
    return count


@njit(cache=True, nogil=True)
def _join(here, above, run, run_above, size, parent):
    upper, lower = -1, -1
    for x in range(here.shape[0]):
        if here[x] != _NONE and abs(here[x] - above[x]) <= _EIGHTHS and (
                run[x] != lower or run_above[x] != upper):
            lower, upper = run[x], run_above[x]
            a, b = find(parent, lower), find(parent, upper)
            if a != b:
                union(parent, size, a, b)

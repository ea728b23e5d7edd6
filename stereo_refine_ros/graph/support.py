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

"""
Sums over the neighbours of like colour, by sweeps along rows and columns.

A neighbour weighs exp(-w / (255 sigma)), w the sum of the colour changes on the way to it, and
fades with every step. A spanning tree of the pixels does no better and costs ten times as much.
"""

from __future__ import annotations

from numba import njit
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.graph.trees import similarity_table
from stereo_refine_ros.graph.tuning import FADE
from stereo_refine_ros.types import FloatMap


def sweep(values: FloatMap, weights: NDArray[np.uint8], sigma: float) -> FloatMap:
    """
    Sum values along rows, then these sums along columns, in both directions.

    Parameters
    ----------
    values : float32 ndarray of shape (H, W)
        What each pixel gives.
    weights : uint8 ndarray of shape (H, W, 2)
        Edge weights of the pixel graph, to the right and downward.
    sigma : float
        Colour change that a vote survives, in units of 255.

    """
    table = similarity_table(sigma) * np.float32(FADE)
    sums = np.empty_like(values)
    _row_kernel(values, weights, table, sums)
    return _column_kernel(sums, weights, table)


@njit(cache=True, nogil=True)
def _row_kernel(values, weights, table, sums):
    height, width = values.shape
    for y in range(height):
        carried = np.float32(0)
        for x in range(width):
            sums[y, x] = carried
            if x + 1 < width:
                carried = (carried + values[y, x]) * table[weights[y, x, 0]]
        carried = np.float32(0)
        for x in range(width - 1, -1, -1):
            carried += values[y, x]
            sums[y, x] += carried
            if x > 0:
                carried *= table[weights[y, x - 1, 0]]


@njit(cache=True, nogil=True)
def _column_kernel(sums, weights, table):
    height, width = sums.shape
    total = np.zeros_like(sums)
    carried = np.zeros(width, np.float32)
    for y in range(height):
        for x in range(width):
            total[y, x] = carried[x]
            carried[x] = (carried[x] + sums[y, x]) * table[weights[y, x, 1]]
    carried[:] = 0
    for y in range(height - 1, -1, -1):
        for x in range(width):
            if y + 1 < height:
                carried[x] *= table[weights[y, x, 1]]
            carried[x] += sums[y, x]
            total[y, x] += carried[x]
    return total

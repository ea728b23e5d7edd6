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
Means over the neighbours of like colour, by sweeps along rows and columns.

A neighbour weighs exp(-w / (255 sigma)), w the sum of the colour changes on the way to it, and
fades with every step. A spanning tree of the pixels does no better and costs ten times as much.
"""

from __future__ import annotations

from numba import njit
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.graph.trees import similarity_table
from stereo_refine_ros.graph.tuning import FADE
from stereo_refine_ros.threads import run_bands
from stereo_refine_ros.types import FloatMap


def mean_of_alike(values: FloatMap, counts: FloatMap, weights: NDArray[np.uint8], sigma: float,
                  threads: int = 1) -> FloatMap:
    """
    Average over the neighbours of like colour and the pixel itself, which counts twice.

    Parameters
    ----------
    values : float32 ndarray of shape (H, W)
        What each pixel gives, 0 where it counts nothing.
    counts : float32 ndarray of shape (H, W)
        How much each pixel counts.
    weights : uint8 ndarray of shape (H, W, 2)
        Edge weights of the pixel graph, to the right and downward.
    sigma : float
        Colour change that a vote survives, in units of 255.
    threads : int
        Bands side by side; the result does not depend on it.

    Returns
    -------
    float32 ndarray of shape (H, W)
        0 where nobody counts.

    """
    table = similarity_table(sigma) * np.float32(FADE)
    height, width = values.shape
    sums, mean = np.empty((height, width, 2), np.float32), np.empty_like(values)
    run_bands(_row_kernel, height, threads, values, counts, weights, table, sums)
    run_bands(_column_kernel, width, threads, values, counts, sums, weights, table, mean)
    return mean


@njit(cache=True, nogil=True)
def _row_kernel(start, stop, values, counts, weights, table, sums):
    width = values.shape[1]
    for y in range(start, stop):
        carried, number = np.float32(0), np.float32(0)
        for x in range(width):
            sums[y, x, 0], sums[y, x, 1] = carried, number
            if x + 1 < width:
                part = table[weights[y, x, 0]]
                carried, number = (carried + values[y, x]) * part, (number + counts[y, x]) * part
        carried, number = np.float32(0), np.float32(0)
        for x in range(width - 1, -1, -1):
            carried, number = carried + values[y, x], number + counts[y, x]
            sums[y, x, 0] += carried
            sums[y, x, 1] += number
            if x > 0:
                part = table[weights[y, x - 1, 0]]
                carried, number = carried * part, number * part


@njit(cache=True, nogil=True)
def _column_kernel(start, stop, values, counts, sums, weights, table, mean):
    height = values.shape[0]
    total = np.empty((height, stop - start, 2), np.float32)
    carried = np.zeros((stop - start, 2), np.float32)
    for y in range(height):
        for x in range(start, stop):
            part = table[weights[y, x, 1]]
            for k in range(2):
                total[y, x - start, k] = carried[x - start, k]
                carried[x - start, k] = (carried[x - start, k] + sums[y, x, k]) * part
    carried[:] = 0
    for y in range(height - 1, -1, -1):
        for x in range(start, stop):
            part = table[weights[y, x, 1]] if y + 1 < height else np.float32(1)
            for k in range(2):
                carried[x - start, k] = carried[x - start, k] * part + sums[y, x, k]
                total[y, x - start, k] += carried[x - start, k]
            number = total[y, x - start, 1] + counts[y, x]
            whole = total[y, x - start, 0] + values[y, x]
            mean[y, x] = whole / number if number > 0 else np.float32(0)

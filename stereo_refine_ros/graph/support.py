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
    sums, mean = np.empty((2, height, width), np.float32), np.empty_like(values)
    run_bands(_row_kernel, height, threads, values, counts, weights, table, sums)
    run_bands(_column_kernel, width, threads, values, counts, sums, weights, table, mean)
    return mean


@njit(cache=True, nogil=True)
def _row_kernel(start, stop, values, counts, weights, table, sums):
    width = values.shape[1]
    parts = np.zeros(width, np.float32)
    for y in range(start, stop):
        value, count, total, number = values[y], counts[y], sums[0, y], sums[1, y]
        for x in range(width - 1):
            parts[x] = table[weights[y, x, 0]]
        carried, counted = np.float32(0), np.float32(0)
        for x in range(width):
            total[x], number[x] = carried, counted
            carried, counted = (carried + value[x]) * parts[x], (counted + count[x]) * parts[x]
        carried, counted = np.float32(0), np.float32(0)
        for x in range(width - 1, -1, -1):
            carried, counted = carried + value[x], counted + count[x]
            total[x] += carried
            number[x] += counted
            carried, counted = carried * parts[max(x - 1, 0)], counted * parts[max(x - 1, 0)]


@njit(cache=True, nogil=True, error_model='numpy')
def _column_kernel(start, stop, values, counts, sums, weights, table, mean):
    height, width = values.shape[0], stop - start
    parts, carried = np.ones((height, width), np.float32), np.zeros((2, width), np.float32)
    from_above = np.empty((2, height, width), np.float32)
    from_above[:, 0] = 0
    for y in range(height - 1):
        part = parts[y]
        for x in range(width):
            part[x] = table[weights[y, start + x, 1]]
        for k in range(2):
            here, there, own = from_above[k, y], from_above[k, y + 1], sums[k, y, start:stop]
            for x in range(width):
                there[x] = (here[x] + own[x]) * part[x]
    for y in range(height - 1, -1, -1):
        for k in range(2):
            _carry(carried[k], parts[y], sums[k, y, start:stop], from_above[k, y])
        total, number, to = from_above[0, y], from_above[1, y], mean[y, start:stop]
        value, count = values[y, start:stop], counts[y, start:stop]
        for x in range(width):
            votes = number[x] + count[x]
            to[x] = (total[x] + value[x]) / votes if votes > 0 else np.float32(0)


@njit(cache=True, nogil=True)
def _carry(carried, part, own, total):
    """Take what a column carries a pixel up, and add it to what comes from above."""
    for x in range(carried.shape[0]):
        carried[x] = carried[x] * part[x] + own[x]
        total[x] += carried[x]

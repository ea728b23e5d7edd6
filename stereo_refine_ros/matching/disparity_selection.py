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

"""Disparity selection: winner takes all, and the parabola through the winner's neighbours."""

from __future__ import annotations

from numba import njit
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.types import FloatMap

IndexMap = NDArray[np.int32]


def select_winners(volume: FloatMap) -> IndexMap:
    """Return the index of the lowest cost of every pixel of a (H, W, D) volume, int32 (H, W)."""
    winners = np.empty(volume.shape[:2], np.int32)
    _winner_kernel(volume.reshape(-1, volume.shape[2]), winners.reshape(-1))
    return winners


def subpixel_offsets(volume: FloatMap, indices: IndexMap) -> FloatMap:
    """
    Fit a parabola through the costs around given indices.

    Returns
    -------
    float32 ndarray of shape (H, W)
        Offset of the parabola's lowest point, -0.5..0.5; 0 at the ends of the range and where
        the cost of the index is not below that of both neighbours.

    """
    offsets = np.empty(indices.shape, np.float32)
    _parabola_kernel(volume.reshape(-1, volume.shape[2]), indices.reshape(-1),
                     offsets.reshape(-1))
    return offsets


@njit(cache=True, nogil=True)
def _winner_kernel(rows, winners):
    for i in range(rows.shape[0]):
        row = rows[i]
        lowest = row[0]
        for k in range(1, row.size):
            lowest = min(lowest, row[k])
        best = 0
        while row[best] > lowest:
            best += 1
        winners[i] = best


@njit(cache=True, nogil=True)
def _parabola_kernel(rows, indices, offsets):
    last = rows.shape[1] - 1
    for i in range(rows.shape[0]):
        k = indices[i]
        offsets[i] = 0
        if k <= 0 or k >= last:
            continue
        before, here, after = rows[i, k - 1], rows[i, k], rows[i, k + 1]
        if here <= min(before, after) and here < max(before, after):
            offsets[i] = np.float32(0.5) * (before - after) / (before - 2 * here + after)

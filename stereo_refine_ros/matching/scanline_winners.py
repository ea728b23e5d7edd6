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
The winners of a row: sub-pixel offsets, uniqueness, and the check of both views.

What was found of a pixel is read in several plain loops of 32-bit numbers, which fill vectors.
"""

from __future__ import annotations

from numba import njit
import numpy as np

from stereo_refine_ros.matching.tuning import COST_WEIGHT, UNIQUENESS_UNIT

_COLUMN_BITS = 20  # of a claim; above them what is paid
WIDEST = (1 << _COLUMN_BITS) - 1
_NOBODY = np.int32((1 << 31) - 1)
_UNIT = np.float32(UNIQUENESS_UNIT)
_MOST_UNIQUE = np.float32(2)


@njit(cache=True, nogil=True)
def finish_row(y, base, min_disparity, last, found, scratch, out):
    """
    Turn what the last path found into the maps of row y; of two claimants the cheaper wins.

    last : the last lane that stands for a disparity
    found : int64 (width,), as `step_last` has it; at most WIDEST
    scratch : int32 (4, width + 1)
    out : disparity, uniqueness and right view's disparity, float32 (H, width)
    """
    disparity, uniqueness, right = out[0][y], out[1][y], out[2][y]
    width = found.shape[0]
    winner, partner, claim, cheapest = scratch[0], scratch[1], scratch[2], scratch[3]
    _read_winner(found, np.int32(min_disparity), winner)
    if base.shape[0] > 1:
        row = base[y]
        for x in range(width):
            winner[x] += row[x]
    _read_disparity(found, np.int32(last), winner, disparity)
    _read_uniqueness(found, uniqueness)
    _claim(found, winner, claim, partner)
    cheapest[:] = _NOBODY
    for x in range(width):
        there = np.uintp(partner[x])
        cheapest[there] = min(cheapest[there], claim[x])
    for x in range(width):
        is_cheapest = cheapest[np.uintp(partner[x])] == claim[x]
        is_kept = is_cheapest and partner[x] < width and uniqueness[x] > 0
        disparity[x] = disparity[x] if is_kept else np.float32(np.nan)
    for x in range(width):
        seen = np.float32((cheapest[x] & np.int32(WIDEST)) - np.int32(x))
        right[x] = seen if cheapest[x] != _NOBODY else np.float32(np.nan)


@njit(cache=True, nogil=True)
def _read_winner(found, min_disparity, winner):
    for x in range(found.shape[0]):
        winner[x] = np.int32(found[x] & 255) + min_disparity


@njit(cache=True, nogil=True, error_model='numpy')
def _read_disparity(found, last, winner, disparity):
    byte = np.int32(255)
    for x in range(found.shape[0]):
        around = np.int32(found[x] >> 32)
        best = (around >> np.int32(8)) & byte
        below, above = (around & byte) - best, (around >> np.int32(16)) - best
        offset = np.float32(0.5) * np.float32(below - above) / np.float32(
            max(max(below, above), np.int32(1)))
        lane = np.int32(found[x]) & byte
        is_inside = (lane > 0) & (lane < last)
        disparity[x] = np.float32(winner[x]) + (offset if is_inside else np.float32(0))


@njit(cache=True, nogil=True)
def _read_uniqueness(found, uniqueness):
    byte = np.int32(255)
    for x in range(found.shape[0]):
        second, best = np.int32(found[x] >> 16) & byte, np.int32(found[x] >> 40) & byte
        uniqueness[x] = min(np.float32(second - best) / _UNIT, _MOST_UNIQUE)


@njit(cache=True, nogil=True)
def _claim(found, winner, claim, partner):
    """Say what each pixel pays, its column behind that, and where; `width` is out of view."""
    byte, width = np.int32(255), np.int32(found.shape[0])
    for x in range(found.shape[0]):
        there = np.int32(x) - winner[x]
        partner[x] = there if (there >= 0) & (there < width) else width
    for x in range(found.shape[0]):
        paid, best = np.int32(found[x] >> 24) & byte, np.int32(found[x] >> 40) & byte
        pays = best + np.int32(COST_WEIGHT) * paid  # below 2^11, since a cost is at most 34
        claim[x] = (pays << np.int32(_COLUMN_BITS)) | np.int32(x)

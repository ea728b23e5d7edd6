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

"""The winners of a row: sub-pixel offsets, uniqueness, and the check of both views."""

from __future__ import annotations

from numba import njit
import numpy as np

from stereo_refine_ros.matching.tuning import UNIQUENESS_UNIT
from stereo_refine_ros.matching.vector_twins import LANES_PER_ITEM

_NOBODY = np.int32(1 << 30)
_NO_DISPARITY = np.int32(-(1 << 20))
_UNIT = np.float32(UNIQUENESS_UNIT)
_MOST_UNIQUE = np.float32(2)


@njit(cache=True, nogil=True)
def finish_row(y, lanes, base, min_disparity, last, found, total, begin, scratch, out):
    """
    Turn what the last path found into the maps of row y; of two claimants the cheaper wins.

    last : the last lane that stands for a disparity
    found : int64 (width,): winning lane, its total and the second's, 16 bits each
    total : uint16, from `begin` on W totals a pixel
    scratch : int32 (6, width)
    out : disparity, uniqueness and right view's disparity, float32 (H, width)
    """
    disparity, uniqueness, right = out
    width = found.shape[0]
    lane_count = len(lanes) * LANES_PER_ITEM
    winner, lane, best, below, above, seen = (
        scratch[0], scratch[1], scratch[2], scratch[3], scratch[4], scratch[5])
    _read(found, y, min_disparity, base, winner, lane, best, uniqueness[y])
    for x in range(width):
        at = np.uintp(begin + x * lane_count + min(max(lane[x], 1), lane_count - 2))
        below[x] = np.int32(total[at - np.uintp(1)]) - best[x]
        above[x] = np.int32(total[at + np.uintp(1)]) - best[x]
    values = disparity[y]
    for x in range(width):
        offset = np.float32(0.5) * np.float32(below[x] - above[x]) / np.float32(
            max(max(below[x], above[x]), 1))
        inside = lane[x] > 0 and lane[x] < last
        values[x] = np.float32(winner[x]) + (offset if inside else np.float32(0))
    _claim(winner, best, below, seen)
    for x in range(width):
        partner = x - winner[x]
        inside = 0 <= partner < width
        there = seen[partner if inside else 0]
        if not inside or there != winner[x] or not uniqueness[y, x] > 0:
            values[x] = np.float32(np.nan)
    there = right[y]
    for x in range(width):
        is_seen = seen[x] != _NO_DISPARITY
        there[x] = np.float32(seen[x]) if is_seen else np.float32(np.nan)


@njit(cache=True, nogil=True)
def _read(found, y, min_disparity, base, winner, lane, best, uniqueness):
    for x in range(found.shape[0]):
        code = found[x]
        lane[x] = np.int32(code & 0xFFFF)
        best[x] = np.int32((code >> 16) & 0xFFFF)
        lead = np.int32((code >> 32) & 0xFFFF) - best[x]
        uniqueness[x] = min(np.float32(lead) / _UNIT, _MOST_UNIQUE)
        winner[x] = lane[x] + np.int32(min_disparity)
    if base.shape[0] > 1:
        for x in range(found.shape[0]):
            winner[x] += base[y, x]


@njit(cache=True, nogil=True)
def _claim(winner, best, claim, seen):
    claim[:] = _NOBODY
    seen[:] = _NO_DISPARITY
    for x in range(winner.shape[0]):
        partner = x - winner[x]
        if 0 <= partner < winner.shape[0] and best[x] < claim[partner]:
            claim[partner] = best[x]
            seen[partner] = winner[x]

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

"""What the scanline paths need of a row: its costs, and where they read and what they pay."""

from __future__ import annotations

from numba import config, njit
import numpy as np

if config.DISABLE_JIT:
    from stereo_refine_ros.matching.vector_twins import LANES_PER_ITEM, match_column
else:
    from stereo_refine_ros.matching.vector_steps import LANES_PER_ITEM, match_column


@njit(cache=True, nogil=True)
def match_row(y, lanes, views, base, settings, cost, to, column, before, stride, least, plan, kept,
              keep_at):
    """Find the costs of a row, and take the path along its columns over it."""
    limits, _, min_disparity, margin, _ = settings
    left, right, mask, outside, size = views
    width = least.shape[0]
    lane_count = len(lanes) * LANES_PER_ITEM
    begin = margin + y * width
    has_windows = base.shape[0] > 1
    for x in range(width):
        first = min_disparity + (np.int64(base[y, x]) if has_windows else 0)
        seat = width - 1 - x + min(max(first, -margin), width)
        large = np.int64(plan[5, x])
        least[x] = match_column(
            lanes, left, right, size, mask, outside, limits[0], limits[1], begin + x,
            begin + seat, margin + seat, cost, to + x * lane_count, column,
            np.int64(plan[4, x]), np.int64(least[x]), large & 255, large >> 8,
            before + x * stride, kept, keep_at + x * lane_count)


@njit(cache=True, nogil=True)
def plan_rows(y, base, flat, settings, shift_limit, lane_count, plan):
    """Lay out where the paths along a row read (0, 2) and their penalties (1, 3)."""
    penalties = settings[1]
    width = plan.shape[1]
    begin = lane_count + 16
    edges = flat[0][y]
    steep = penalties[0, 0, 0] | (penalties[0, 0, 1] << 8)
    even = penalties[0, 1, 0] | (penalties[0, 1, 1] << 8)
    for x in range(width):
        plan[1, x] = even if edges[x] else steep
    for x in range(width - 1):
        plan[3, x] = plan[1, x + 1]
    plan[3, width - 1] = even
    plan[0, :] = begin
    plan[2, :] = begin
    if base.shape[0] > 1:
        for x in range(1, width):
            plan[0, x] = begin + min(max(base[y, x] - base[y, x - 1], -shift_limit), shift_limit)
        for x in range(width - 1):
            plan[2, x] = begin + min(max(base[y, x] - base[y, x + 1], -shift_limit), shift_limit)


@njit(cache=True, nogil=True)
def plan_column(y, neighbour, edge, base, flat, settings, before, stride, shift_limit, plan):
    """Lay out where the path along the columns reads (4) and its penalties (5)."""
    penalties = settings[1]
    edges = flat[1][edge]
    steep = penalties[1, 0, 0] | (penalties[1, 0, 1] << 8)
    even = penalties[1, 1, 0] | (penalties[1, 1, 1] << 8)
    for x in range(plan.shape[1]):
        plan[5, x] = even if edges[x] else steep
        plan[4, x] = before + x * stride
    if base.shape[0] > 1:
        for x in range(plan.shape[1]):
            plan[4, x] += min(max(base[y, x] - base[neighbour, x], -shift_limit), shift_limit)

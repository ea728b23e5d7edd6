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
    from stereo_refine_ros.matching.vector_twins import (
        LANES_PER_ITEM, LEFT_PLANES, match_column, SPAN)
else:
    from stereo_refine_ros.matching.vector_steps import (
        LANES_PER_ITEM, LEFT_PLANES, match_column, SPAN)


@njit(cache=True, nogil=True)
def match_row(y, edge, lanes, views, base, flat, settings, cost, to, column, before, stride, plan,
              kept, keep_at):
    """Find the costs of a row, and take the path along its columns, whose flags row `edge` has."""
    limits, table, min_disparity, margin, _ = settings
    left, right, mask, outside, size = views
    here = np.empty(LEFT_PLANES * SPAN, np.uint32)
    width = plan.shape[1]
    lane_count = len(lanes) * LANES_PER_ITEM
    begin = margin + y * width
    downs = flat[1]
    has_windows = base.shape[0] > 1
    for x in range(width):
        at = x % SPAN
        if at == 0:
            _lay_out(left, y * width + x, min(SPAN, width - x), here)
        first = min_disparity + (np.int64(base[y, x]) if has_windows else 0)
        seat = width - 1 - x + min(max(first, -margin), width)
        match_column(
            lanes, here, right, size, mask, outside, limits[0], limits[1], at, begin + seat,
            margin + seat, cost, to + x * lane_count, column, np.int64(plan[2, x]),
            before + x * stride, table, downs, edge * width + x, kept, keep_at + x * lane_count)


@njit(cache=True, nogil=True)
def _lay_out(left, begin, count, here):
    """Repeat every byte of some pixels' features four times."""
    size = left.shape[0] // LEFT_PLANES
    for k in range(LEFT_PLANES):
        plane, to = left[k * size + begin:k * size + begin + count], here[k * SPAN:]
        for i in range(count):
            to[i] = np.uint32(plane[i]) * np.uint32(0x01010101)


@njit(cache=True, nogil=True)
def plan_still(begin, before, stride, plan):
    """
    Lay out where the paths read that go on in the same window.

    plan : int32 (3, width): from the left, from the right, along the column
    """
    plan[:2] = begin
    for x in range(plan.shape[1]):
        plan[2, x] = before + x * stride


@njit(cache=True, nogil=True)
def plan_rows(y, base, shift_limit, begin, plan):
    """Shift where the paths along a row read by the steps of its windows."""
    width = plan.shape[1]
    if base.shape[0] > 1:
        for x in range(1, width):
            plan[0, x] = begin + min(max(base[y, x] - base[y, x - 1], -shift_limit), shift_limit)
        for x in range(width - 1):
            plan[1, x] = begin + min(max(base[y, x] - base[y, x + 1], -shift_limit), shift_limit)


@njit(cache=True, nogil=True)
def plan_column(y, neighbour, base, before, stride, shift_limit, plan):
    """Shift where the path along the columns reads by the steps from a neighbour's windows."""
    if base.shape[0] > 1:
        for x in range(plan.shape[1]):
            shift = min(max(base[y, x] - base[neighbour, x], -shift_limit), shift_limit)
            plan[2, x] = before + x * stride + shift

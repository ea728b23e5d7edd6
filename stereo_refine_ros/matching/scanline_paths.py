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
Four-path scanline optimisation in one pass over the image (Hirschmueller 2008).

Every path carries L(p, d) = C(p, d) + min(L(q, d), L(q, d +- 1) + P1, min L(q) + P2) - min L(q)
with q the pixel before p. Rows are taken in strips: first the upward path of a strip, which
starts RUN_UP rows below it, then downward, rightward and leftward, two rows side by side, the
second LAG pixels behind the first, which hides the latency of the steps. So no volume leaves the
cache, and each thread needs a strip's costs only. Bands of rows are fixed, so the result does not
depend on the number of threads.

A pixel may look at a window of the disparities that begins at its own `base`: paths are shifted
by the difference of two windows.

Helpers that take arrays inside the loops over x would count references there, and signed indices
add tests for wrapping: hence flat arrays, offsets laid out row by row, and plain loops.
"""

from __future__ import annotations

from numba import njit
import numpy as np

from stereo_refine_ros.matching.vector_steps import (
    keep_excess, LANES_PER_ITEM, pixel_cost, step_both, step_column, step_column_keeping,
    step_last)

LAG = 8
STRIP = 48
RUN_UP = 12
_ROW_STATES = 4
_NOBODY = np.int32(1 << 30)
_NO_DISPARITY = np.int32(-(1 << 20))


@njit(cache=True, nogil=True)
def band_kernel(start, stop, lanes, views, mask, base, flat, settings, out):
    """
    Match rows start..stop.

    lanes : tuple of LANES_PER_ITEM disparities an item
    views : two tuples of flat uint8 planes, left and mirrored right, with `margin` entries
        before the first pixel and behind the last
    mask : uint8 (W,), 255 for lanes outside the range
    base : int32 (H, width) or (1, 1): first disparity of every pixel's window
    flat : two uint8 (H, width): 1 where the step from the left, from above crosses no edge
    settings : (limits, penalties, min_disparity, margin, out_of_view)
    out : subpixel float32 (H, width), NaN where both views disagree; winner int32, least, second
        and excess uint8 (H * width * W) or empty; right int32 (H, width)
    """
    height, width = flat[0].shape
    lane_count = len(lanes) * LANES_PER_ITEM
    has_windows = base.shape[0] > 1
    shift_limit = lane_count + 1 if has_windows else 0
    before = shift_limit + 1
    stride = (2 * before + lane_count + 15) // 16 * 16
    half = width * stride
    row = width * lane_count
    column, column_least = np.full(2 * half, 255, np.uint8), np.zeros(width, np.uint8)
    up, up_least = np.full(2 * half, 255, np.uint8), np.zeros(width, np.uint8)
    row_offset = 3 * lane_count + 32
    row_state = 2 * row_offset
    row_states = np.full(_ROW_STATES * row_state, 255, np.uint8)
    spare = np.empty(row, np.uint8)
    kept = np.empty(STRIP * row, np.uint8)
    cost = np.empty(STRIP * row, np.uint8)
    total = np.empty(2 * row, np.uint16)
    plan = np.empty((2, 6, width), np.int32)
    found = np.empty((2, width), np.int64)
    scratch = np.empty((6, width), np.int32)
    first = max(0, start - RUN_UP)
    _reset_column(column, column_least, before, stride, lane_count)
    here, there = 0, half
    for y in range(first, start):
        _cost_row(y, lanes, views, mask, base, settings, spare, 0)
        _plan_column(y, max(y - 1, first), y, base, flat, settings, before, stride, shift_limit,
                     plan[0])
        for x in range(width):
            large = np.int64(plan[0, 5, x])
            column_least[x] = step_column(
                lanes, column, here + np.int64(plan[0, 4, x]), np.int64(column_least[x]),
                large & 255, large >> 8, there + before + x * stride, spare, x * lane_count)
        here, there = there, here
    for top in range(start, stop, STRIP):
        end = min(top + STRIP, stop)
        _upward(top, end, lanes, views, mask, base, flat, settings, before, stride, shift_limit,
                up, up_least, cost, spare, kept, plan)
        y = top
        while y < end:
            two = y + 1 < end
            at = (y - top) * row
            for k in range(2 if two else 1):
                _plan_rows(y + k, base, flat, settings, shift_limit, lane_count, plan[k])
                _plan_column(y + k, max(y + k - 1, first), y + k, base, flat, settings, before,
                             stride, shift_limit, plan[k])
            _reset_rows(row_states, row_state, row_offset, lane_count)
            _ahead(lanes, row_states, row_state, row_offset, column, here, there, before, stride,
                   column_least, cost, total, at, row, plan, two)
            _reset_rows(row_states, row_state, row_offset, lane_count)
            _back(lanes, row_states, row_state, row_offset, cost, total, kept, at, row, plan,
                  found, two)
            for k in range(2 if two else 1):
                _finish(y + k, lanes, base, settings, found[k], total, k * row, scratch, out)
            if not two:
                here, there = there, here
            y += 2


@njit(cache=True, nogil=True)
def _reset_column(state, least, before, stride, lane_count):
    for x in range(least.shape[0]):
        state[x * stride + before:x * stride + before + lane_count] = 0
    least[:] = 0


@njit(cache=True, nogil=True)
def _reset_rows(states, size, offset, lane_count):
    for k in range(0, _ROW_STATES, 2):
        begin = k * size + lane_count + 16
        states[begin:begin + lane_count] = 0
        states[begin + offset:begin + offset + lane_count] = 0


@njit(cache=True, nogil=True)
def _cost_row(y, lanes, views, mask, base, settings, cost, to):
    """Fill the costs of a row; a partner outside the right view costs the same for all."""
    limits, _, min_disparity, margin, out_of_view = settings
    width = views[2]
    lane_count = len(lanes) * LANES_PER_ITEM
    left, right = views[0], views[1]
    begin = margin + y * width
    has_windows = base.shape[0] > 1
    for x in range(width):
        first = min_disparity + (np.int64(base[y, x]) if has_windows else 0)
        first = min(max(first, -width), 2 * width)
        pixel_cost(lanes, left, right, mask, limits[0], limits[1], begin + x,
                   begin + width - 1 - x + first, cost, to + x * lane_count)
    for x in range(width):
        first = min_disparity + (np.int64(base[y, x]) if has_windows else 0)
        for i in range(max(0, x - first + 1), lane_count):
            cost[to + x * lane_count + i] = max(out_of_view, mask[i])
        for i in range(0, min(max(0, x - first - width + 1), lane_count)):
            cost[to + x * lane_count + i] = max(out_of_view, mask[i])


@njit(cache=True, nogil=True)
def _plan_rows(y, base, flat, settings, shift_limit, lane_count, plan):
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
def _plan_column(y, neighbour, edge, base, flat, settings, before, stride, shift_limit, plan):
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


@njit(cache=True, nogil=True)
def _upward(top, end, lanes, views, mask, base, flat, settings, before, stride, shift_limit,
            state, least, cost, spare, kept, plan):
    """Fill the costs of a strip, and the values of the path that comes up from below it."""
    width = least.shape[0]
    lane_count = len(lanes) * LANES_PER_ITEM
    row = width * lane_count
    here, there = 0, width * stride
    last = min(end + RUN_UP, flat[0].shape[0]) - 1
    _reset_column(state, least, before, stride, lane_count)
    for y in range(last, top - 1, -1):
        below = min(y + 1, last)
        _plan_column(y, below, below, base, flat, settings, before, stride, shift_limit, plan[0])
        if y >= end:
            _cost_row(y, lanes, views, mask, base, settings, spare, 0)
            for x in range(width):
                large = np.int64(plan[0, 5, x])
                least[x] = step_column(
                    lanes, state, here + np.int64(plan[0, 4, x]), np.int64(least[x]),
                    large & 255, large >> 8, there + before + x * stride, spare, x * lane_count)
        else:
            at = (y - top) * row
            _cost_row(y, lanes, views, mask, base, settings, cost, at)
            for x in range(width):
                large = np.int64(plan[0, 5, x])
                least[x] = step_column_keeping(
                    lanes, state, here + np.int64(plan[0, 4, x]), np.int64(least[x]),
                    large & 255, large >> 8, there + before + x * stride, cost,
                    at + x * lane_count, kept, at + x * lane_count)
        here, there = there, here


@njit(cache=True, nogil=True)
def _ahead(lanes, rows, size, offset, column, here, there, before, stride, least, cost, total, at,
           row, plan, two):
    """Run the rightward and the downward path over one row, and over the next if there is one."""
    width = least.shape[0]
    lane_count = len(lanes) * LANES_PER_ITEM
    first_least, second_least = 0, 0
    begin = lane_count + 16
    for z in range(width + LAG if two else width):
        now = size * (z & 1)
        if z < width:
            p, q = np.int64(plan[0, 1, z]), np.int64(plan[0, 5, z])
            both = step_both(
                lanes, rows, now + np.int64(plan[0, 0, z]), first_least, p & 255, p >> 8,
                size - now + begin, column, here + np.int64(plan[0, 4, z]), np.int64(least[z]),
                q & 255, q >> 8, there + before + z * stride, cost, at + z * lane_count, total,
                z * lane_count, offset)
            first_least = both & 255
            least[z] = both >> 8
        x = z - LAG
        if two and x >= 0:
            p, q = np.int64(plan[1, 1, x]), np.int64(plan[1, 5, x])
            both = step_both(
                lanes, rows, 2 * size + now + np.int64(plan[1, 0, x]), second_least, p & 255,
                p >> 8, 3 * size - now + begin, column, there + np.int64(plan[1, 4, x]),
                np.int64(least[x]), q & 255, q >> 8, here + before + x * stride, cost,
                at + row + x * lane_count, total, row + x * lane_count, offset)
            second_least = both & 255
            least[x] = both >> 8


@njit(cache=True, nogil=True)
def _back(lanes, rows, size, offset, cost, total, kept, at, row, plan, found, two):
    """Run the leftward path over one row or two, add all paths and find the winners."""
    width = found.shape[1]
    lane_count = len(lanes) * LANES_PER_ITEM
    first_least, second_least = 0, 0
    begin = lane_count + 16
    for z in range(width):
        now = size * (z & 1)
        x = width - 1 - z
        p = np.int64(plan[0, 3, x])
        one = step_last(
            lanes, rows, now + np.int64(plan[0, 2, x]), first_least, p & 255, p >> 8,
            size - now + begin, cost, at + x * lane_count, total, x * lane_count, kept,
            at + x * lane_count, offset)
        first_least = one & 255
        found[0, x] = one >> 8
        if two:
            p = np.int64(plan[1, 3, x])
            one = step_last(
                lanes, rows, 2 * size + now + np.int64(plan[1, 2, x]), second_least, p & 255,
                p >> 8, 3 * size - now + begin, cost, at + row + x * lane_count, total,
                row + x * lane_count, kept, at + row + x * lane_count, offset)
            second_least = one & 255
            found[1, x] = one >> 8


@njit(cache=True, nogil=True)
def _finish(y, lanes, base, settings, found, total, begin, scratch, out):
    """Winners of a row, their sub-pixel offsets, and the check of both views."""
    subpixel, least, second, right, excess = out
    min_disparity = settings[2]
    width = found.shape[0]
    lane_count = len(lanes) * LANES_PER_ITEM
    has_windows = base.shape[0] > 1
    winner, lane, best, below, above, claim = (
        scratch[0], scratch[1], scratch[2], scratch[3], scratch[4], scratch[5])
    seen = right[y]
    claim[:] = _NOBODY
    seen[:] = _NO_DISPARITY
    for x in range(width):
        code = found[x]
        lane[x] = np.int32(code & 0xFFFF)
        best[x] = np.int32((code >> 16) & 0xFFFF)
        least[y, x] = np.uint16((code >> 16) & 0xFFFF)
        second[y, x] = np.uint16((code >> 32) & 0xFFFF)
        winner[x] = lane[x] + np.int32(min_disparity)
    if has_windows:
        for x in range(width):
            winner[x] += base[y, x]
    for x in range(width):
        at = np.uintp(begin + x * lane_count + min(max(lane[x], 1), lane_count - 2))
        below[x] = np.int32(total[at - np.uintp(1)]) - best[x]
        above[x] = np.int32(total[at + np.uintp(1)]) - best[x]
        partner = x - winner[x]
        if 0 <= partner < width and best[x] < claim[partner]:
            claim[partner] = best[x]
            seen[partner] = winner[x]
    for x in range(width):
        offset = np.float32(0.5) * np.float32(below[x] - above[x]) / np.float32(
            max(max(below[x], above[x]), 1))
        inside = lane[x] > 0 and lane[x] < lane_count - 1
        subpixel[y, x] = np.float32(winner[x]) + (offset if inside else np.float32(0))
    if excess.shape[0] > 0:
        for x in range(width):
            keep_excess(lanes, total, begin + x * lane_count, np.int64(best[x]), excess,
                        (y * width + x) * lane_count)
    for x in range(width):
        partner = x - winner[x]
        agrees = 0 <= partner < width and abs(seen[max(min(partner, width - 1), 0)] - winner[x]) <= 1
        if not agrees:
            subpixel[y, x] = np.float32(np.nan)

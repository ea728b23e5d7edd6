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
by the difference of two windows. What lies outside the window of the pixel before is a wall; along
rows so is the neighbour just inside it, seen from the first disparity outside.

Helpers that take arrays inside the loops over x would count references there, and signed indices
add tests for wrapping: hence flat arrays, offsets laid out row by row, and plain loops.
"""

from __future__ import annotations

from numba import config, njit
import numpy as np

from stereo_refine_ros.matching.scanline_rows import match_row, plan_column, plan_rows
from stereo_refine_ros.matching.scanline_winners import finish_row

if config.DISABLE_JIT:
    from stereo_refine_ros.matching.vector_twins import (
        LANES_PER_ITEM, step_both, step_column, step_last)
else:
    from stereo_refine_ros.matching.vector_steps import (
        LANES_PER_ITEM, step_both, step_column, step_last)

LAG = 8
STRIP = 48
RUN_UP = 12
# Rows whose costs are at hand: those of a strip, and of the run-up below it.
_RING = STRIP + RUN_UP
_ROW_STATES = 4


def work_size(width: int, lane_count: int, has_windows: bool) -> int:
    """Return how many bytes `band_kernel` works in; as many again at most hold its totals."""
    return (4 * width * _layout(lane_count, has_windows)[2]
            + (1 + STRIP + _RING) * width * lane_count)


@njit(cache=True, nogil=True)
def _layout(lane_count, has_windows):
    """Return the farthest shift of a window, where a column's state begins, and its stride."""
    shift_limit = lane_count + 1 if has_windows else 0
    before = shift_limit + 1
    return shift_limit, before, (2 * before + lane_count + 15) // 16 * 16


@njit(cache=True, nogil=True)
def band_kernel(start, stop, lanes, views, base, flat, settings, work, out):
    """
    Match rows start..stop.

    lanes : tuple of LANES_PER_ITEM disparities an item
    views : left and mirrored right planes (flat uint8, `margin` entries before the first pixel
        and behind the last of each plane); mask uint8 (W,), 255 for lanes outside the range;
        uint8 (width + 2 * margin), cost of a partner outside the view, 0 inside; size of a plane
    base : int32 (H, width) or (1, 1): first disparity of every pixel's window
    flat : two uint8 (H, width): 1 where the step from the left, from above crosses no edge
    settings : (limits, penalties, min_disparity, margin, last lane of the range)
    work : uint8 (work_size,) and uint16 (2 * width * W), overwritten
    out : disparity, uniqueness, right view's disparity, float32 (H, width), NaN where there is
        none
    """
    height, width = flat[0].shape
    lane_count = len(lanes) * LANES_PER_ITEM
    shift_limit, before, stride = _layout(lane_count, base.shape[0] > 1)
    half = width * stride
    row = width * lane_count
    arena, total = work
    arena[:4 * half] = 255
    column, up = arena[:2 * half], arena[2 * half:4 * half]
    spare = arena[4 * half:4 * half + row]
    kept = arena[4 * half + row:4 * half + (1 + STRIP) * row]
    cost = arena[4 * half + (1 + STRIP) * row:4 * half + (1 + STRIP + _RING) * row]
    column_least, up_least = np.zeros(width, np.uint8), np.zeros(width, np.uint8)
    row_offset = 3 * lane_count + 32
    row_state = 2 * row_offset
    row_states = np.full(_ROW_STATES * row_state, 255, np.uint8)
    plan = np.empty((2, 6, width), np.int32)
    found = np.empty((2, width), np.int64)
    scratch = np.empty((6, width), np.int32)
    first = max(0, start - RUN_UP)
    _reset_column(column, column_least, before, stride, lane_count)
    here, there = 0, half
    for y in range(first, start):
        plan_column(y, max(y - 1, first), y, base, flat, settings, before, stride, shift_limit,
                    plan[0])
        match_row(y, lanes, views, base, settings, spare, 0, column, here, there + before, stride,
                  column_least, plan[0], spare, 0)
        here, there = there, here
    known = start
    for top in range(start, stop, STRIP):
        end = min(top + STRIP, stop)
        known = _upward(top, end, known, lanes, views, base, flat, settings, before, stride,
                        shift_limit, up, up_least, cost, spare, kept, plan)
        y = top
        while y < end:
            two = y + 1 < end
            at, next_at = y % _RING * row, (y + 1) % _RING * row
            for k in range(2 if two else 1):
                plan_rows(y + k, base, flat, settings, shift_limit, lane_count, plan[k])
                plan_column(y + k, max(y + k - 1, first), y + k, base, flat, settings, before,
                             stride, shift_limit, plan[k])  # noqa: E127
            _reset_rows(row_states, row_state, row_offset, lane_count)
            _ahead(lanes, row_states, row_state, row_offset, column, here, there, before, stride,
                   column_least, cost, total, at, next_at, row, plan, two)
            _reset_rows(row_states, row_state, row_offset, lane_count)
            _back(lanes, row_states, row_state, row_offset, cost, total, kept, at, next_at,
                  (y - top) * row, row, plan, found, two)
            for k in range(2 if two else 1):
                finish_row(y + k, lanes, base, settings[2], settings[4], found[k], total, k * row,
                           scratch, out)
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
def _upward(top, end, known, lanes, views, base, flat, settings, before, stride, shift_limit,
            state, least, cost, spare, kept, plan):
    """
    Keep the values of the path that comes up from below a strip, for every row of the strip.

    The costs of rows from `known` on are found on the way; returns the first row without.
    """
    width = least.shape[0]
    lane_count = len(lanes) * LANES_PER_ITEM
    row = width * lane_count
    here, there = 0, width * stride
    last = min(end + RUN_UP, flat[0].shape[0]) - 1
    _reset_column(state, least, before, stride, lane_count)
    for y in range(last, top - 1, -1):
        below = min(y + 1, last)
        plan_column(y, below, below, base, flat, settings, before, stride, shift_limit, plan[0])
        at = y % _RING * row
        to, keep_at = (kept, (y - top) * row) if y < end else (spare, 0)
        if y >= known:
            match_row(y, lanes, views, base, settings, cost, at, state, here, there + before,
                      stride, least, plan[0], to, keep_at)
        else:
            for x in range(width):
                large = np.int64(plan[0, 5, x])
                least[x] = step_column(
                    lanes, state, here + np.int64(plan[0, 4, x]), np.int64(least[x]),
                    large & 255, large >> 8, there + before + x * stride, cost,
                    at + x * lane_count, to, keep_at + x * lane_count)
        here, there = there, here
    return last + 1


@njit(cache=True, nogil=True)
def _ahead(lanes, rows, size, offset, column, here, there, before, stride, least, cost, total, at,
           next_at, row, plan, two):
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
                next_at + x * lane_count, total, row + x * lane_count, offset)
            second_least = both & 255
            least[x] = both >> 8


@njit(cache=True, nogil=True)
def _back(lanes, rows, size, offset, cost, total, kept, at, next_at, kept_at, row, plan, found,
          two):
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
            kept_at + x * lane_count, offset)
        first_least = one & 255
        found[0, x] = one >> 8
        if two:
            p = np.int64(plan[1, 3, x])
            one = step_last(
                lanes, rows, 2 * size + now + np.int64(plan[1, 2, x]), second_least, p & 255,
                p >> 8, 3 * size - now + begin, cost, next_at + x * lane_count, total,
                row + x * lane_count, kept, kept_at + row + x * lane_count, offset)
            second_least = one & 255
            found[1, x] = one >> 8

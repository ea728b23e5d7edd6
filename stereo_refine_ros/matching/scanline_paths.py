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

Every path carries L(p, d) = C(p, d) + min(L(q, d), L(q, d +- 1) + P1, P2), less its least over d,
with q the pixel before p. Rows are taken in strips: first the upward path of a strip, which
starts RUN_UP rows below it, then downward, rightward and leftward, ABREAST rows side by side,
each LAG pixels behind the one above it, which hides the latency of the steps. So no volume leaves
the cache, and each thread needs a strip's costs only. Bands of rows are fixed, so the result does
not depend on the number of threads.

A pixel may look at a window of the disparities that begins at its own `base`: paths are shifted
by the difference of two windows. What lies outside the window of the pixel before is a wall; along
rows so is the neighbour just inside it, seen from the first disparity outside.

Helpers that take arrays inside the loops over x would count references there, and signed indices
add tests for wrapping: hence flat arrays, offsets laid out row by row, and plain loops.
"""

from __future__ import annotations

from numba import config, njit
import numpy as np

from stereo_refine_ros.matching.scanline_rows import match_row, plan_column, plan_rows, plan_still
from stereo_refine_ros.matching.scanline_winners import finish_row
from stereo_refine_ros.matching.scratch import LINE

if config.DISABLE_JIT:
    from stereo_refine_ros.matching.vector_twins import (
        LANES_PER_ITEM, step_both, step_column, step_last)
else:
    from stereo_refine_ros.matching.vector_steps import (
        LANES_PER_ITEM, step_both, step_column, step_last)

LAG = 8
ABREAST = 4
STRIP = 48
RUN_UP = 12
_RING = STRIP + RUN_UP


def work_size(width: int, lane_count: int, has_windows: bool) -> int:
    """Return how many bytes `band_kernel` works in."""
    states = _states_layout(width, lane_count, has_windows)
    return (states[-1] + (1 + STRIP + _RING) * width * lane_count + LINE
            + ABREAST * _sums_size(lane_count))


@njit(cache=True, nogil=True)
def _sums_size(lane_count):
    """Return the bytes for the sums of a pixel, and for a line before and behind them."""
    return lane_count + 2 * LINE


@njit(cache=True, nogil=True)
def _column_layout(lane_count, has_windows):
    """Return the farthest shift of a window, where a column's state begins, and its stride."""
    shift_limit = lane_count + 1 if has_windows else 0
    before = shift_limit + 1
    return shift_limit, before, (2 * before + lane_count + 15) // 16 * 16


@njit(cache=True, nogil=True)
def _row_layout(lane_count):
    """Return where a row's state begins, how far behind its neighbours lie, and its size."""
    begin = (lane_count + 2 + LINE - 1) // LINE * LINE
    offset = (begin + 2 * lane_count + 2 + LINE - 1) // LINE * LINE
    return begin, offset, 2 * offset


@njit(cache=True, nogil=True)
def _states_layout(width, lane_count, has_windows):
    """Return where the states of the rows and of both paths along columns end."""
    rows = 2 * ABREAST * _row_layout(lane_count)[2]
    column = width * _column_layout(lane_count, has_windows)[2]
    return rows, rows + column, rows + 2 * column


@njit(cache=True, nogil=True)
def band_kernel(start, stop, lanes, views, base, flat, settings, work, out):
    """
    Match rows start..stop.

    lanes : tuple of LANES_PER_ITEM disparities an item
    views : left planes, flat uint8 (LEFT_PLANES * H * width,); mirrored right planes (`margin`
        entries before the first pixel and behind the last of each); mask uint8 (W,), 255 for
        lanes outside the range; uint8 (width + 2 * margin), cost of a partner outside the view,
        0 inside; size of a right plane
    base : int32 (H, width) or (1, 1): first disparity of every pixel's window
    flat : two uint8 (H * width,): 1 where the step from the left, from above crosses no edge
    settings : (limits, table of penalties, min_disparity, margin, last lane of the range)
    work : uint8 (work_size,), as `scratch` lends it, overwritten
    out : disparity, uniqueness, right view's disparity, float32 (H, width), NaN where there is
        none
    """
    height, width = out[0].shape
    lane_count = len(lanes) * LANES_PER_ITEM
    layout = _column_layout(lane_count, base.shape[0] > 1)
    shift_limit, before, stride = layout
    row_layout = _row_layout(lane_count)
    row = width * lane_count
    rows_end, column_end, states_end = _states_layout(width, lane_count, base.shape[0] > 1)
    work[:states_end] = 255
    rows, column, up = work[:rows_end], work[rows_end:column_end], work[column_end:states_end]
    arena = work[(states_end + LINE - 1) // LINE * LINE:]
    spare, kept = arena[:row], arena[row:(1 + STRIP) * row]
    cost = arena[(1 + STRIP) * row:(1 + STRIP + _RING) * row]
    sums = arena[(1 + STRIP + _RING) * row:]
    plan = np.empty((ABREAST, 3, width), np.int32)
    found = np.empty((ABREAST, width), np.int64)
    scratch = np.empty((4, width + 1), np.int32)
    for k in range(ABREAST):
        plan_still(row_layout[0], before, stride, plan[k])
    first = max(0, start - RUN_UP)
    _reset_column(column, width, before, stride, lane_count)
    for y in range(first, start):
        plan_column(y, max(y - 1, first), base, before, stride, shift_limit, plan[0])
        match_row(y, y, lanes, views, base, flat, settings, spare, 0, column, before, stride,
                  plan[0], spare, 0)
    known = start
    for top in range(start, stop, STRIP):
        end = min(top + STRIP, stop)
        known = _upward(top, end, known, height, lanes, views, base, flat, settings, layout, up,
                        cost, spare, kept, plan[0])
        for y in range(top, end, ABREAST):
            count = min(ABREAST, end - y)
            for k in range(count):
                plan_rows(y + k, base, shift_limit, row_layout[0], plan[k])
                plan_column(y + k, max(y + k - 1, first), base, before, stride, shift_limit,
                            plan[k])
            _reset_rows(rows, row_layout, lane_count)
            _ahead(lanes, y, count, rows, row_layout, column, before, stride, settings[1], flat,
                   cost, kept, (y - top) * row, row, plan)
            _reset_rows(rows, row_layout, lane_count)
            _back(lanes, y, count, rows, row_layout, settings[1], flat, cost, kept,
                  (y - top) * row, sums, row, plan, found)
            for k in range(count):
                finish_row(y + k, base, settings[2], settings[4], found[k], scratch, out)


@njit(cache=True, nogil=True)
def _reset_column(state, width, before, stride, lane_count):
    for x in range(width):
        state[x * stride + before:x * stride + before + lane_count] = 0


@njit(cache=True, nogil=True)
def _reset_rows(states, row_layout, lane_count):
    begin, offset, size = row_layout
    for k in range(0, 2 * ABREAST, 2):
        first = k * size + begin
        states[first:first + lane_count] = 0
        states[first + offset:first + offset + lane_count] = 0


@njit(cache=True, nogil=True)
def _upward(top, end, known, height, lanes, views, base, flat, settings, layout, state, cost,
            spare, kept, plan):
    """
    Keep the values of the path that comes up from below a strip, for every row of the strip.

    The costs of rows from `known` on are found on the way; returns the first row without.
    """
    shift_limit, before, stride = layout
    width = plan.shape[1]
    lane_count = len(lanes) * LANES_PER_ITEM
    row = width * lane_count
    table, downs = settings[1], flat[1]
    last = min(end + RUN_UP, height) - 1
    _reset_column(state, width, before, stride, lane_count)
    for y in range(last, top - 1, -1):
        below = min(y + 1, last)
        plan_column(y, below, base, before, stride, shift_limit, plan)
        at = y % _RING * row
        to, keep_at = (kept, (y - top) * row) if y < end else (spare, 0)
        if y >= known:
            match_row(y, below, lanes, views, base, flat, settings, cost, at, state, before,
                      stride, plan, to, keep_at)
        else:
            for x in range(width):
                step_column(
                    lanes, state, np.int64(plan[2, x]), before + x * stride, table, downs,
                    below * width + x, cost, at + x * lane_count, to, keep_at + x * lane_count)
    return last + 1


@njit(cache=True, nogil=True)
def _ahead(lanes, y, count, rows, row_layout, column, before, stride, table, flat, cost, kept,
           kept_at, row, plan):
    """Add the rightward and the downward path over rows y..y + count, LAG pixels apart."""
    width = plan.shape[2]
    lane_count = len(lanes) * LANES_PER_ITEM
    begin, offset, size = row_layout
    alongs, downs = flat
    for z in range(width + LAG * (count - 1)):
        for k in range(count):
            x = z - LAG * k
            if x < 0 or x >= width:
                continue
            here = size * (2 * k + (x & 1))
            there = size * (2 * k + 1 - (x & 1))
            step_both(
                lanes, rows, here + np.int64(plan[k, 0, x]), there + begin, column,
                np.int64(plan[k, 2, x]), before + x * stride, table, alongs, downs,
                (y + k) * width + x, cost, (y + k) % _RING * row + x * lane_count, kept,
                kept_at + k * row + x * lane_count, offset)


@njit(cache=True, nogil=True)
def _back(lanes, y, count, rows, row_layout, table, flat, cost, kept, kept_at, sums, row, plan,
          found):
    """Add the leftward path over rows y..y + count, and find the winners."""
    width = found.shape[1]
    lane_count = len(lanes) * LANES_PER_ITEM
    begin, offset, size = row_layout
    alongs = flat[0]
    for z in range(width):
        x = width - 1 - z
        neighbour = min(x + 1, width - 1)
        for k in range(count):
            here = size * (2 * k + (z & 1))
            there = size * (2 * k + 1 - (z & 1))
            found[k, x] = step_last(
                lanes, rows, here + np.int64(plan[k, 1, x]), there + begin, table, alongs,
                (y + k) * width + neighbour, cost, (y + k) % _RING * row + x * lane_count, kept,
                kept_at + k * row + x * lane_count, sums, LINE + k * _sums_size(lane_count),
                offset)

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

from stereo_refine_ros.matching.scanline_rows import match_row, plan_column, plan_rows
from stereo_refine_ros.matching.scanline_winners import finish_row

if config.DISABLE_JIT:
    from stereo_refine_ros.matching.vector_twins import (
        LANES_PER_ITEM, step_both, step_column, step_last)
else:
    from stereo_refine_ros.matching.vector_steps import (
        LANES_PER_ITEM, step_both, step_column, step_last)

LAG = 8
# Rows side by side: as many as hide the latency of the steps.
ABREAST = 4
STRIP = 48
RUN_UP = 12
# Rows whose costs are at hand: those of a strip, and of the run-up below it.
_RING = STRIP + RUN_UP


def work_size(width: int, lane_count: int, has_windows: bool) -> int:
    """Return how many bytes `band_kernel` works in, its totals aside."""
    return (2 * width * _layout(lane_count, has_windows)[2]
            + (1 + STRIP + _RING) * width * lane_count)


def totals_size(width: int, lane_count: int) -> int:
    """Return how many bytes the totals of `band_kernel` take."""
    return 2 * ABREAST * width * lane_count


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
    work : uint8 (work_size,) and uint16 (totals_size / 2,), overwritten
    out : disparity, uniqueness, right view's disparity, float32 (H, width), NaN where there is
        none
    """
    height, width = flat[0].shape
    lane_count = len(lanes) * LANES_PER_ITEM
    layout = _layout(lane_count, base.shape[0] > 1)
    shift_limit, before, stride = layout
    states = width * stride
    row = width * lane_count
    arena, total = work
    arena[:2 * states] = 255
    column, up = arena[:states], arena[states:2 * states]
    spare = arena[2 * states:2 * states + row]
    kept = arena[2 * states + row:2 * states + (1 + STRIP) * row]
    cost = arena[2 * states + (1 + STRIP) * row:2 * states + (1 + STRIP + _RING) * row]
    column_least, up_least = np.zeros(width, np.uint8), np.zeros(width, np.uint8)
    offset = 3 * lane_count + 32
    size = 2 * offset
    rows = np.full(2 * ABREAST * size, 255, np.uint8)
    plan = np.empty((ABREAST, 6, width), np.int32)
    found = np.empty((ABREAST, width), np.int64)
    scratch = np.empty((6, width), np.int32)
    first = max(0, start - RUN_UP)
    _reset_column(column, column_least, before, stride, lane_count)
    for y in range(first, start):
        plan_column(y, max(y - 1, first), y, base, flat, settings, before, stride, shift_limit,
                    plan[0])
        match_row(y, lanes, views, base, settings, spare, 0, column, before, stride, column_least,
                  plan[0], spare, 0)
    known = start
    for top in range(start, stop, STRIP):
        end = min(top + STRIP, stop)
        known = _upward(top, end, known, lanes, views, base, flat, settings, layout, up, up_least,
                        cost, spare, kept, plan)
        for y in range(top, end, ABREAST):
            count = min(ABREAST, end - y)
            for k in range(count):
                plan_rows(y + k, base, flat, settings, shift_limit, lane_count, plan[k])
                plan_column(y + k, max(y + k - 1, first), y + k, base, flat, settings, before,
                             stride, shift_limit, plan[k])  # noqa: E127
            _reset_rows(rows, size, offset, lane_count)
            _ahead(lanes, y, count, rows, size, offset, column, before, stride, column_least,
                   cost, total, row, plan)
            _reset_rows(rows, size, offset, lane_count)
            _back(lanes, y, count, rows, size, offset, cost, total, kept, (y - top) * row, row,
                  plan, found)
            for k in range(count):
                finish_row(y + k, lanes, base, settings[2], settings[4], found[k], total, k * row,
                           scratch, out)


@njit(cache=True, nogil=True)
def _reset_column(state, least, before, stride, lane_count):
    for x in range(least.shape[0]):
        state[x * stride + before:x * stride + before + lane_count] = 0
    least[:] = 0


@njit(cache=True, nogil=True)
def _reset_rows(states, size, offset, lane_count):
    for k in range(0, 2 * ABREAST, 2):
        begin = k * size + lane_count + 16
        states[begin:begin + lane_count] = 0
        states[begin + offset:begin + offset + lane_count] = 0


@njit(cache=True, nogil=True)
def _upward(top, end, known, lanes, views, base, flat, settings, layout, state, least, cost, spare,
            kept, plan):
    """
    Keep the values of the path that comes up from below a strip, for every row of the strip.

    The costs of rows from `known` on are found on the way; returns the first row without.
    """
    shift_limit, before, stride = layout
    width = least.shape[0]
    lane_count = len(lanes) * LANES_PER_ITEM
    row = width * lane_count
    last = min(end + RUN_UP, flat[0].shape[0]) - 1
    _reset_column(state, least, before, stride, lane_count)
    for y in range(last, top - 1, -1):
        below = min(y + 1, last)
        plan_column(y, below, below, base, flat, settings, before, stride, shift_limit, plan[0])
        at = y % _RING * row
        to, keep_at = (kept, (y - top) * row) if y < end else (spare, 0)
        if y >= known:
            match_row(y, lanes, views, base, settings, cost, at, state, before, stride, least,
                      plan[0], to, keep_at)
        else:
            for x in range(width):
                large = np.int64(plan[0, 5, x])
                least[x] = step_column(
                    lanes, state, np.int64(plan[0, 4, x]), np.int64(least[x]), large & 255,
                    large >> 8, before + x * stride, cost, at + x * lane_count, to,
                    keep_at + x * lane_count)
    return last + 1


@njit(cache=True, nogil=True)
def _begin_rows(y, count, row):
    """Return the least values that paths begin with, and where the costs of their rows are."""
    at = np.empty(ABREAST, np.int64)
    for k in range(count):
        at[k] = (y + k) % _RING * row
    return np.zeros(ABREAST, np.int64), at


@njit(cache=True, nogil=True)
def _ahead(lanes, y, count, rows, size, offset, column, before, stride, least, cost, total, row,
           plan):
    """Run the rightward and the downward path over rows y..y + count, LAG pixels apart."""
    width = least.shape[0]
    lane_count = len(lanes) * LANES_PER_ITEM
    row_least, at = _begin_rows(y, count, row)
    begin = lane_count + 16
    for z in range(width + LAG * (count - 1)):
        for k in range(count):
            x = z - LAG * k
            if x < 0 or x >= width:
                continue
            here = size * (2 * k + (x & 1))
            there = size * (2 * k + 1 - (x & 1))
            p, q = np.int64(plan[k, 1, x]), np.int64(plan[k, 5, x])
            both = step_both(
                lanes, rows, here + np.int64(plan[k, 0, x]), row_least[k], p & 255, p >> 8,
                there + begin, column, np.int64(plan[k, 4, x]), np.int64(least[x]), q & 255,
                q >> 8, before + x * stride, cost, at[k] + x * lane_count, total,
                k * row + x * lane_count, offset)
            row_least[k] = both & 255
            least[x] = both >> 8


@njit(cache=True, nogil=True)
def _back(lanes, y, count, rows, size, offset, cost, total, kept, kept_at, row, plan, found):
    """Run the leftward path over rows y..y + count, add all paths and find the winners."""
    width = found.shape[1]
    lane_count = len(lanes) * LANES_PER_ITEM
    row_least, at = _begin_rows(y, count, row)
    begin = lane_count + 16
    for z in range(width):
        x = width - 1 - z
        for k in range(count):
            here = size * (2 * k + (z & 1))
            there = size * (2 * k + 1 - (z & 1))
            p = np.int64(plan[k, 3, x])
            one = step_last(
                lanes, rows, here + np.int64(plan[k, 2, x]), row_least[k], p & 255, p >> 8,
                there + begin, cost, at[k] + x * lane_count, total, k * row + x * lane_count,
                kept, kept_at + k * row + x * lane_count, offset)
            row_least[k] = one & 255
            found[k, x] = one >> 8

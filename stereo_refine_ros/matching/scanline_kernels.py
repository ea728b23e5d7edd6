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
Scanline optimisation on a cost volume (Hirschmueller 2008; penalties of Mei et al. 2011).

Every path carries L(p, d) = C(p, d) + min(L(q, d), L(q, d +- 1) + P1, min L(q) + P2) - min L(q)
with q the pixel before p. L stays below max C + P2, which is chosen to leave room for P1 within
8 bits. Casts are spelled out: numba widens integers, and only the narrow form fills the vector
registers.
"""

from __future__ import annotations

from numba import njit
import numpy as np

from stereo_refine_ros.matching.robust_cost import fill_cost_row

_FAR = np.int16(16000)
# The key of a total nobody has; padding, at _FAR, is not below it.
_NOBODY = np.int32(16000 << 12)
# Stands before the first and behind the last disparity; with P1 on top it still fits 8 bits.
WALL = np.uint8(195)


@njit(cache=True, nogil=True, inline='always')
def _step(before, least, cost, flat, limits, after, total, depth):
    """
    Advance a path by one pixel and add it to `total`; returns the least entry of `after`.

    `before` and `after` hold P + 2 entries, walls at 0 and at depth + 1. `flat` is 255 where the
    right view is flat at a disparity, else 0; `limits` holds P1 and what flatness adds to it,
    then the same of P2.
    """
    lowest = WALL
    small_least, small_rise, large_rise = limits[0], limits[1], limits[3]
    large_least = np.uint8(limits[2] + least)
    for i in range(cost.shape[0]):
        small = np.uint8(small_least + np.uint8(flat[i] & small_rise))
        large = np.uint8(large_least + np.uint8(flat[i] & large_rise))
        best = min(before[i + 1], np.uint8(min(before[i], before[i + 2]) + small))
        best = min(best, large)
        value = np.uint8(cost[i] + np.uint8(best - least))
        after[i + 1] = value
        total[i] = np.int16(total[i] + np.int16(value))
        lowest = min(lowest, value)
    # Padding costs the most there is, so it is never below `lowest`; but nobody may pass it.
    after[depth + 1] = WALL
    return lowest


# Views: features of both images, edges along the rows and edges along the columns of both.
# Limits: of `_step`, by axis (rows first) and by whether the left view is flat.
# Volumes: cost (uint8) and total (int16), (H, W, P). State of the vertical paths: what two rows
# hold (2, 2, W, P + 2), by direction and parity, and the least entries (2, W).
# Range: min_disparity and num_disparities.


@njit(cache=True, nogil=True)
def near_half_kernel(start, stop, views, limits, span, volumes, state):
    """
    Go from the top (direction 0) or the bottom (1) to the middle; directions start..stop.

    Fills costs and horizontal paths and adds the vertical path. The two directions meet in the
    middle and never touch the same row, so they may run side by side.
    """
    left, right, row_edges, column_edges = views
    cost, total = volumes
    height = cost.shape[0]
    for direction in range(start, stop):
        for step in range(height // 2 if direction == 0 else height - height // 2):
            y = height - 1 - step if direction else step
            fill_cost_row(y, left, right, span[0], span[1], cost[y])
            _horizontal_row(y, cost[y], span[1], row_edges, limits[0], total[y])
            _vertical_row(y, step, direction, cost[y], span[1], column_edges, limits[1], total[y],
                          state)


@njit(cache=True, nogil=True)
def far_half_kernel(start, stop, views, limits, span, volumes, state, winners):
    """Go on from the middle to the other end, where a row becomes complete and has winners."""
    _, _, _, column_edges = views
    cost, total = volumes
    winner, subpixel, least, right_winner = winners
    height = cost.shape[0]
    for direction in range(start, stop):
        for step in range(height // 2 if direction == 0 else height - height // 2, height):
            y = height - 1 - step if direction else step
            _vertical_row(y, step, direction, cost[y], span[1], column_edges, limits[1], total[y],
                          state)
            _winner_row(total[y], span, winner[y], subpixel[y], least[y], right_winner[y])


@njit(cache=True, nogil=True)
def _horizontal_row(y, cost, depth, edges, limits, total):
    """Set `total` of a row to the left-to-right plus the right-to-left path."""
    flat_left, flat_right = edges
    width, padded = cost.shape
    near = np.full(padded + 2, WALL, np.uint8)
    far = np.full(padded + 2, WALL, np.uint8)
    total[:, :depth] = 0
    total[:, depth:] = _FAR
    for backward in range(2):
        least = np.uint8(0)
        near[1:depth + 1] = 0
        for step in range(width):
            x = width - 1 - step if backward else step
            edge = x + backward
            least = _step(near, least, cost[x], flat_right[y, width - edge:],
                          limits[flat_left[y, edge] & 1], far, total[x], depth)
            near, far = far, near


@njit(cache=True, nogil=True)
def _vertical_row(y, step, direction, cost, depth, edges, limits, total, state):
    """Add the vertical path of a row to `total` and remember it for the next."""
    flat_left, flat_right = edges
    carried, least = state
    width = cost.shape[0]
    near, far = carried[direction, step & 1], carried[direction, 1 - (step & 1)]
    edge = y + direction
    for x in range(width):
        least[direction, x] = _step(
            near[x], least[direction, x], cost[x], flat_right[edge, width - 1 - x:],
            limits[flat_left[edge, x] & 1], far[x], total[x], depth)


@njit(cache=True, nogil=True)
def _winner_row(total, span, winner, subpixel, least, right_winner):
    """
    Left view: index of the least total, that with its sub-pixel offset, and the total.

    Right view: index of the least total on the diagonal x + d; -1 where no left pixel reaches.
    """
    min_disparity, depth = span
    width, padded = total.shape
    # A mirrored row of right pixels, padded by P at either end, runs with growing d.
    on_diagonal = np.full(width + 2 * padded, _NOBODY, np.int32)
    for x in range(width):
        row = total[x]
        lowest = on_diagonal[min(max(width - 1 - x + min_disparity + padded, 0), width + padded):]
        # Value and index in one number: the least of them is the first of the least values.
        best = np.int32(_NOBODY)
        for i in range(padded):
            key = np.int32((np.int32(row[i]) << np.int32(12)) | np.int32(i))
            lowest[i] = min(lowest[i], key)
            best = min(best, key)
        index = np.int64(best & np.int32(4095))
        winner[x] = index
        least[x] = row[index]
        subpixel[x] = np.float32(index)
        if 0 < index < depth - 1:
            before = np.float32(row[index - 1] - row[index])
            after = np.float32(row[index + 1] - row[index])
            if before + after > 0:
                # Two lines of equal slope, not a parabola: absolute differences have a kink.
                subpixel[x] += np.float32(0.5) * (before - after) / max(before, after)
    for x in range(width):
        best = on_diagonal[width - 1 - x + padded]
        right_winner[x] = -1 if best >= _NOBODY else best & np.int32(4095)

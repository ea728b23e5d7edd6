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

_FAR = np.int16(16000)
# Stands before the first and behind the last disparity; with P1 on top it still fits 8 bits.
_WALL = np.uint8(195)


@njit(cache=True, nogil=True, inline='always')
def _step(before, least, cost, flat, limits, after, total, depth):
    """
    Advance a path by one pixel and add it to `total`; returns the least entry of `after`.

    `before` and `after` hold P + 2 entries, walls at 0 and at depth + 1. `flat` is 255 where the
    right view is flat at a disparity, else 0; `limits` holds P1 and what flatness adds to it,
    then the same of P2.
    """
    lowest = _WALL
    for i in range(cost.shape[0]):
        small = np.uint8(limits[0] + np.uint8(flat[i] & limits[1]))
        large = np.uint8(limits[2] + np.uint8(flat[i] & limits[3]))
        best = min(before[i + 1], np.uint8(min(before[i], before[i + 2]) + small))
        best = min(best, np.uint8(least + large))
        value = np.uint8(cost[i] + np.uint8(best - least))
        after[i + 1] = value
        total[i] = np.int16(total[i] + np.int16(value))
        lowest = min(lowest, value)
    # Padding costs the most there is, so it is never below `lowest`; but nobody may pass it.
    after[depth + 1] = _WALL
    return lowest


@njit(cache=True, nogil=True)
def _horizontal_kernel(start, stop, cost, depth, flat_left, flat_right, limits, total):
    """
    Set `total` to the left-to-right plus the right-to-left path, rows start..stop.

    flat_left : uint8 (H, W + 1), 255 where the step into column x from x - 1 crosses no edge.
    flat_right : uint8 (H, W + 1 + P), mirrored and padded, so that growing i is growing d.
    """
    _, width, padded = cost.shape
    near = np.full(padded + 2, _WALL, np.uint8)
    far = np.full(padded + 2, _WALL, np.uint8)
    for y in range(start, stop):
        total[y] = 0
        total[y, :, depth:] = _FAR
        for backward in range(2):
            least = np.uint8(0)
            near[1:depth + 1] = 0
            for step in range(width):
                x = width - 1 - step if backward else step
                edge = x + backward
                least = _step(near, least, cost[y, x], flat_right[y, width - edge:],
                              limits[flat_left[y, edge] & 1], far, total[y, x], depth)
                near, far = far, near


@njit(cache=True, nogil=True)
def _vertical_kernel(start, stop, cost, depth, flat_left, flat_right, limits, total):
    """
    Add the downward and the upward path to `total`, columns start..stop.

    flat_left : uint8 (H + 1, W), 255 where the step into row y from y - 1 crosses no edge.
    flat_right : uint8 (H + 1, W + P), mirrored and padded.
    """
    height, width, padded = cost.shape
    near = np.full((stop - start, padded + 2), _WALL, np.uint8)
    far = near.copy()
    least = np.zeros(stop - start, np.uint8)
    for upward in range(2):
        near[:, 1:depth + 1] = 0
        least[:] = 0
        for step in range(height):
            y = height - 1 - step if upward else step
            edge = y + upward
            for x in range(start, stop):
                i = x - start
                least[i] = _step(near[i], least[i], cost[y, x], flat_right[edge, width - 1 - x:],
                                 limits[flat_left[edge, x] & 1], far[i], total[y, x], depth)
            near, far = far, near


@njit(cache=True, nogil=True)
def _winner_kernel(start, stop, total, depth, winner, subpixel, least):
    """Left view: index of the least total, that with its parabola offset, and the total."""
    _, width, padded = total.shape
    for y in range(start, stop):
        for x in range(width):
            row = total[y, x]
            lowest = np.int16(row[0])
            for i in range(padded):
                lowest = min(lowest, row[i])
            best = 0
            while row[best] != lowest:
                best += 1
            winner[y, x] = best
            least[y, x] = lowest
            offset = np.float32(0)
            if 0 < best < depth - 1:
                before = np.float32(row[best - 1] - lowest)
                after = np.float32(row[best + 1] - lowest)
                if before + after > 0:
                    offset = np.float32(0.5) * (before - after) / (before + after)
            subpixel[y, x] = np.float32(best) + offset


@njit(cache=True, nogil=True)
def _right_winner_kernel(start, stop, total, min_disparity, winner):
    """
    Right view: least total on the diagonal x + d of the left volume, rows start..stop.

    A mirrored row of right pixels, padded by P at either end, runs with growing d.
    """
    _, width, padded = total.shape
    least = np.empty(width + 2 * padded, np.int16)
    index = np.empty(width + 2 * padded, np.int16)
    for y in range(start, stop):
        least[:] = _FAR
        index[:] = -1
        for x in range(width):
            row = total[y, x]
            begin = min(max(width - 1 - x + min_disparity + padded, 0), width + padded)
            lowest = least[begin:]
            best = index[begin:]
            for i in range(padded):
                is_lower = row[i] < lowest[i]
                best[i] = np.int16(i) if is_lower else best[i]
                lowest[i] = min(lowest[i], row[i])
        for x in range(width):
            winner[y, x] = index[width - 1 - x + padded]


@njit(cache=True, nogil=True)
def _flat_kernel(image, down, threshold, flat):
    """Set 255 where the step into a pixel from the one above or before crosses no edge, else 0."""
    height, width, channels = image.shape
    for y in range(down, height):
        for x in range(1 - down, width):
            largest = np.int32(0)
            for c in range(channels):
                change = np.int32(image[y, x, c]) - np.int32(image[y - down, x - 1 + down, c])
                largest = max(largest, abs(change))
            flat[y, x] = 255 if largest < threshold else 0

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
The steps of `vector_steps` in plain numpy: what runs where numba is switched off.

Same names, arguments and results, so that debuggers, coverage and tests see every line of the
matcher.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

LANES_PER_ITEM = 16
# Features of a pixel: two gradients, then three bytes of each of two censuses.
PLANES = 8
# And of one of the left view three more: which bits of the second census count.
LEFT_PLANES = 11
# Pixels of a row of the left view whose features are laid out at a time.
SPAN = 64

Lanes = tuple[int, ...]
Bytes = NDArray[np.uint8]
Words = NDArray[np.uint32]
_BITS = np.array([bin(byte).count('1') for byte in range(256)])


def match_column(lanes: Lanes, here: Words, right: Bytes, size: int, mask: Bytes, outside: Bytes,
                 slope_limit: int, census_limit: int, at: int, partner: int, seat: int,
                 cost: Bytes, to: int, column: Bytes, begin: int, end: int, table: Bytes,
                 flags: Bytes, flag_at: int, kept: Bytes, keep_at: int) -> None:
    """Compare a pixel with its partners, and take the path along its column on to it."""
    width = len(lanes) * LANES_PER_ITEM
    ours = [int(here[k * SPAN + at]) & 255 for k in range(LEFT_PLANES)]
    there = [_part(right, k * size + partner, width) for k in range(PLANES)]
    slope = sum(np.abs(ours[k] - there[k]) for k in range(2))
    counts = [255] * 3 + ours[PLANES:]
    bits = sum(_BITS[(ours[k] ^ there[k]) & counts[k - 2]] for k in range(2, PLANES))
    fresh = np.minimum(slope, slope_limit) + np.minimum(bits, census_limit)
    veil = _part(outside, seat, width)
    cost[to:to + width] = np.where(veil == 0, fresh, veil) | mask[:width]
    step_column(lanes, column, begin, end, table, flags, flag_at, cost, to, kept, keep_at)


def step_both(lanes: Lanes, row: Bytes, row_from: int, row_to: int, column: Bytes,
              column_from: int, column_to: int, table: Bytes, along_flags: Bytes,
              down_flags: Bytes, flag_at: int, cost: Bytes, at: int, total: Bytes, to: int,
              offset: int) -> None:
    """Take the path along a row and the one down its column a pixel on."""
    width = len(lanes) * LANES_PER_ITEM
    fresh = _part(cost, at, width)
    along = _advance_row(row, row_from, row_to, offset,
                         _penalties(table, 0, along_flags[flag_at], width), fresh)
    down = _advance_column(column, column_from, column_to,
                           _penalties(table, 1, down_flags[flag_at], width), fresh)
    total[to:to + width] = np.minimum(_part(total, to, width) + along + down, 255)


def step_column(lanes: Lanes, column: Bytes, begin: int, end: int, table: Bytes, flags: Bytes,
                flag_at: int, cost: Bytes, at: int, kept: Bytes, to: int) -> None:
    """Take the path along a column a pixel on."""
    width = len(lanes) * LANES_PER_ITEM
    kept[to:to + width] = _advance_column(
        column, begin, end, _penalties(table, 1, flags[flag_at], width), _part(cost, at, width))


def step_last(lanes: Lanes, row: Bytes, begin: int, end: int, table: Bytes, flags: Bytes,
              flag_at: int, cost: Bytes, at: int, total: Bytes, back: int, sums: Bytes, to: int,
              offset: int) -> int:
    """Take the last path along a row a pixel on, add it to the total, and find the winner."""
    width = len(lanes) * LANES_PER_ITEM
    fresh = _part(cost, at, width)
    along = _advance_row(row, begin, end, offset, _penalties(table, 0, flags[flag_at], width),
                         fresh)
    whole = np.minimum(_part(total, back, width) + along, 255)
    sums[to:to + width] = whole
    lane = int(whole.argmin())
    far = np.abs(np.arange(width) - lane) > 2
    around = _part(sums, to + lane - 1, 3)
    return (lane | int(whole[far].min()) << 16 | int(fresh[lane]) << 24
            | sum(int(around[k]) << (32 + 8 * k) for k in range(3)))


def _part(values: Bytes, begin: int, width: int) -> NDArray[np.int64]:
    assert 0 <= begin <= len(values) - width, 'a vector step reads outside its array'
    return values[begin:begin + width].astype(np.int64)


def _penalties(table: Bytes, axis: int, flag: int, width: int) -> tuple[int, int]:
    first = (4 * axis + 2 * int(flag)) * width
    return int(table[first]), int(table[first + width])


def _advance(values: NDArray[np.int64], beside: NDArray[np.int64], penalties: tuple[int, int],
             fresh: NDArray[np.int64]) -> NDArray[np.int64]:
    small, large = penalties
    best = np.minimum(np.minimum(values, np.minimum(beside + small, 255)), large)
    after = np.minimum(fresh + best, 255)
    return after - after.min()


def _advance_row(state: Bytes, begin: int, end: int, offset: int, penalties: tuple[int, int],
                 fresh: NDArray[np.int64]) -> NDArray[np.int64]:
    width = len(fresh)
    after = _advance(_part(state, begin, width), _part(state, begin + offset, width), penalties,
                     fresh)
    state[end:end + width] = after
    walled = np.pad(after, 1, constant_values=255)
    state[end + offset:end + offset + width] = np.minimum(walled[:-2], walled[2:])
    return after


def _advance_column(state: Bytes, begin: int, end: int, penalties: tuple[int, int],
                    fresh: NDArray[np.int64]) -> NDArray[np.int64]:
    width = len(fresh)
    beside = np.minimum(_part(state, begin - 1, width), _part(state, begin + 1, width))
    after = _advance(_part(state, begin, width), beside, penalties, fresh)
    state[end:end + width] = after
    return after

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
PLANES = 8

Lanes = tuple[int, ...]
Bytes = NDArray[np.uint8]
_BITS = np.array([bin(byte).count('1') for byte in range(256)])


def match_column(lanes: Lanes, left: Bytes, right: Bytes, size: int, mask: Bytes, outside: Bytes,
                 slope_limit: int, census_limit: int, at: int, partner: int, seat: int,
                 cost: Bytes, to: int, column: Bytes, begin: int, least: int, small: int,
                 large: int, end: int, kept: Bytes, keep_at: int) -> int:
    """Compare a pixel with its partners, and take the path along its column on to it."""
    width = len(lanes) * LANES_PER_ITEM
    here = [int(left[k * size + at]) for k in range(PLANES)]
    there = [_part(right, k * size + partner, width) for k in range(PLANES)]
    slope = sum(np.abs(here[k] - there[k]) for k in range(2))
    bits = sum(_BITS[here[k] ^ there[k]] for k in range(2, PLANES))
    fresh = np.minimum(slope, slope_limit) + np.minimum(bits, census_limit)
    veil = _part(outside, seat, width)
    cost[to:to + width] = np.where(veil == 0, fresh, veil) | mask[:width]
    return step_column(lanes, column, begin, least, small, large, end, cost, to, kept, keep_at)


def step_both(lanes: Lanes, row: Bytes, row_from: int, row_least: int, row_small: int,
              row_large: int, row_to: int, column: Bytes, column_from: int, column_least: int,
              column_small: int, column_large: int, column_to: int, cost: Bytes, at: int,
              total: NDArray[np.uint16], to: int, offset: int) -> int:
    """Take the path along a row and the one down its column a pixel on."""
    width = len(lanes) * LANES_PER_ITEM
    fresh = _part(cost, at, width)
    along = _advance_row(row, row_from, row_to, offset, (row_least, row_small, row_large), fresh)
    down = _advance_column(column, column_from, column_to,
                           (column_least, column_small, column_large), fresh)
    total[to:to + width] = along + down
    return int(along.min()) | int(down.min()) << 8


def step_column(lanes: Lanes, column: Bytes, begin: int, least: int, small: int, large: int,
                end: int, cost: Bytes, at: int, kept: Bytes, to: int) -> int:
    """Take the path along a column a pixel on; returns its least value."""
    width = len(lanes) * LANES_PER_ITEM
    values = _advance_column(column, begin, end, (least, small, large), _part(cost, at, width))
    kept[to:to + width] = values
    return int(values.min())


def step_last(lanes: Lanes, row: Bytes, begin: int, least: int, small: int, large: int, end: int,
              cost: Bytes, at: int, total: NDArray[np.uint16], to: int, up: Bytes, back: int,
              offset: int) -> int:
    """Take the last path along a row a pixel on, complete the total, and find its winner."""
    width = len(lanes) * LANES_PER_ITEM
    fresh = _part(cost, at, width)
    along = _advance_row(row, begin, end, offset, (least, small, large), fresh)
    sums = total[to:to + width] + along + _part(up, back, width)
    total[to:to + width] = sums
    lane = int(sums.argmin())
    far = np.abs(np.arange(width) - lane) > 2
    second = int(sums[far].min())
    return int(along.min()) | lane << 8 | int(sums[lane]) << 24 | second << 40


def _part(values: Bytes, begin: int, width: int) -> NDArray[np.int64]:
    assert 0 <= begin <= len(values) - width, 'a vector step reads outside its array'
    return values[begin:begin + width].astype(np.int64)


def _advance(values: NDArray[np.int64], beside: NDArray[np.int64], penalties: tuple[int, int, int],
             fresh: NDArray[np.int64]) -> NDArray[np.int64]:
    least, small, large = penalties
    best = np.minimum(values, np.minimum(beside + small, 255))
    best = np.minimum(best, min(least + large, 255)) - least
    return np.minimum(fresh + best, 255)


def _advance_row(state: Bytes, begin: int, end: int, offset: int,
                 penalties: tuple[int, int, int], fresh: NDArray[np.int64]) -> NDArray[np.int64]:
    width = len(fresh)
    after = _advance(_part(state, begin, width), _part(state, begin + offset, width), penalties,
                     fresh)
    state[end:end + width] = after
    walled = np.pad(after, 1, constant_values=255)
    state[end + offset:end + offset + width] = np.minimum(walled[:-2], walled[2:])
    return after


def _advance_column(state: Bytes, begin: int, end: int, penalties: tuple[int, int, int],
                    fresh: NDArray[np.int64]) -> NDArray[np.int64]:
    width = len(fresh)
    beside = np.minimum(_part(state, begin - 1, width), _part(state, begin + 1, width))
    after = _advance(_part(state, begin, width), beside, penalties, fresh)
    state[end:end + width] = after
    return after

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

"""Filling holes from the background."""

import numpy as np

from stereo_refine_ros.refinement.filling import fill_from_background, fill_sides

N = np.nan


def naive_fill(values):
    """One hole after another, row by row; then empty rows from the nearest filled one."""
    out = values.copy()
    for row, line in enumerate(values):
        for column in np.flatnonzero(np.isnan(line)):
            left, right = line[:column], line[column + 1:]
            sides = [side for side in (left[~np.isnan(left)][-1:], right[~np.isnan(right)][:1])
                     if side.size]
            if sides:
                out[row, column] = min(side[0] for side in sides)
    filled = [row for row in range(len(values)) if not np.isnan(values[row]).all()]
    for row in range(len(values)):
        if filled and row not in filled:
            out[row] = out[min(filled, key=lambda other: (abs(other - row), other))]
    return out


def test_by_hand():
    values = np.array([[N, 4, N, N, 7, N], [9, N, 2, N, N, 5]], np.float32)
    expected = [[4, 4, 4, 4, 7, 7], [9, 2, 2, 2, 2, 5]]
    np.testing.assert_array_equal(fill_from_background(values), expected)


def test_both_sides_by_hand():
    values = np.array([[N, 4, N, N, 7, N], [9, N, 2, N, N, 5], [N] * 6], np.float32)
    back, front = fill_sides(values)
    np.testing.assert_array_equal(back[:2], [[4, 4, 4, 4, 7, 7], [9, 2, 2, 2, 2, 5]])
    np.testing.assert_array_equal(front[:2], [[4, 4, 7, 7, 7, 7], [9, 9, 2, 5, 5, 5]])
    np.testing.assert_array_equal(back[2], back[1])
    np.testing.assert_array_equal(front[2], front[1])
    assert back.dtype == front.dtype == np.float32


def test_the_background_is_never_nearer_than_the_foreground():
    rng = np.random.default_rng(2)
    values = rng.uniform(0, 60, (13, 9)).astype(np.float32)
    values[rng.random(values.shape) < 0.7] = N
    back, front = fill_sides(values)
    assert np.all(back <= front) and np.any(back < front)
    np.testing.assert_array_equal(back, fill_from_background(values))
    # In front is behind of the map turned inside out.
    np.testing.assert_array_equal(front, -fill_from_background(-values))
    known = np.isfinite(values)
    np.testing.assert_array_equal(front[known], values[known])


def test_rows_without_data_take_the_nearest():
    values = np.full((5, 2), N, np.float32)
    values[1], values[3, 0] = (3, N), 8
    np.testing.assert_array_equal(
        fill_from_background(values), [[3, 3], [3, 3], [3, 3], [8, 8], [8, 8]])


def test_matches_the_naive_fill_and_leaves_its_input():
    rng = np.random.default_rng(11)
    for share in (0.1, 0.6, 0.97):
        values = rng.uniform(0, 60, (13, 9)).astype(np.float32)
        values[rng.random(values.shape) < share] = N
        before = values.copy()
        np.testing.assert_array_equal(fill_from_background(values), naive_fill(values))
        np.testing.assert_array_equal(values, before)


def test_nothing_valid_stays_nothing_and_full_stays_full():
    assert np.isnan(fill_from_background(np.full((3, 4), N, np.float32))).all()
    full = np.arange(12, dtype=np.float32).reshape(3, 4)
    out = fill_from_background(full)
    np.testing.assert_array_equal(out, full)
    assert not np.shares_memory(out, full)

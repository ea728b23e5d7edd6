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

"""The left-right check, the forward warp and speckles, against slow versions and by hand."""

import matching_reference
import numpy as np
import pytest

from stereo_refine_ros.matching.consistency import left_right_check, remove_speckles

NAN = np.float32('nan')


def random_map(seed, low=-3.0, high=6.0):
    generator = np.random.default_rng(seed)
    values = generator.uniform(low, high, (6, 12)).astype(np.float32)
    values[generator.random(values.shape) < 0.2] = np.nan
    return values


@pytest.mark.parametrize('tolerance', [0.0, 1.0, 2.5])
def test_check_is_the_naive_one(tolerance):
    for whole in (False, True):
        left, right = (np.rint(random_map(s)) if whole else random_map(s) for s in (1, 2))
        np.testing.assert_array_equal(
            left_right_check(left, right, tolerance),
            matching_reference.left_right_check(left, right, tolerance))


def test_check_by_hand():
    left = np.array([[0, 1, 2, 2, NAN, 2]], np.float32)
    right = np.array([[2, 2, 0, 3, 1, 0]], np.float32)
    # Columns meet 0, 0, 0, 1, nothing, 3.
    assert left_right_check(left, right, 0).tolist() == [[False, False, True, True, False, False]]
    assert left_right_check(left, right, 1).tolist() == [[False, True, True, True, False, True]]


def test_check_refuses_maps_of_two_sizes():
    with pytest.raises(ValueError, match=r'right: expected shape \(2, 3\), got \(3, 2\)'):
        left_right_check(np.zeros((2, 3), np.float32), np.zeros((3, 2), np.float32), 0)


@pytest.mark.parametrize('size, step', [(0, 1.0), (1, 1.0), (3, 0.5), (3, 2.0), (6, 1.0)])
def test_removal_of_speckles_is_the_naive_one(size, step):
    for seed in range(4):
        values = np.rint(random_map(seed, low=0) * 2) / 2
        before = values.copy()
        np.testing.assert_array_equal(
            remove_speckles(values, size, step),
            matching_reference.remove_speckles(values, size, step))
        np.testing.assert_array_equal(values, before)


@pytest.mark.parametrize('disparity', [-2048.0, 4094.75])
def test_speckles_are_found_over_the_whole_range(disparity):
    values = np.full((4, 5), disparity, np.float32)
    values[2, 3] += 3 if disparity < 0 else -3
    kept = remove_speckles(values, 1, 2.0)
    assert kept.dtype == np.float32 and np.argwhere(np.isnan(kept)).tolist() == [[2, 3]]
    np.testing.assert_array_equal(remove_speckles(values, 1, 3.0), values)

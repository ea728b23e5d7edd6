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

"""The truncated cost and its census against slow versions."""

import numpy as np
import pytest
import scanline_reference

from stereo_refine_ros.matching.robust_cost import (
    census_5x5, COST_UNIT, DEPTH_STEP, OUT_OF_VIEW, PADDING)
from stereo_refine_ros.matching.scanline import gather_evidence
from stereo_refine_ros.params import MatchingParams
from stereo_refine_ros.types import StereoPair


@pytest.fixture(autouse=True)
def wrapping_allowed():
    """Let unsigned scalars wrap round where the kernels run as plain Python."""
    with np.errstate(over='ignore'):
        yield


def robust_cost_volume(pair, min_disparity, num_disparities, threads=1):
    """Return the costs that the paths go over."""
    params = MatchingParams('scanline', min_disparity, num_disparities)
    return gather_evidence(pair, params, threads)[0].cost


def random_pair(shape, seed=0, reach=256):
    rng = np.random.default_rng(seed)
    return StereoPair(*rng.integers(0, reach, (2, *shape), dtype=np.uint8))


@pytest.mark.parametrize('shape', [(6, 7), (1, 1), (1, 5), (5, 1)])
def test_census_marks_the_darker_neighbours(shape):
    grey = np.random.default_rng(1).integers(0, 5, shape, dtype=np.uint8)
    for (y, x), bits in np.ndenumerate(census_5x5(grey)):
        expected = scanline_reference.census_bits(grey.astype(int), y, x)
        assert [bool(int(bits) >> (23 - i) & 1) for i in range(24)] == expected
        assert int(bits) < 1 << 24


@pytest.mark.parametrize('shape, min_disparity, num_disparities, reach', [
    ((5, 9), 0, 6, 256), ((5, 9, 3), 0, 6, 40), ((4, 7, 3), -3, 7, 60), ((3, 6), 2, 3, 20),
    ((2, 5, 3), -9, 20, 30), ((1, 1), 0, 1, 256), ((1, 4, 3), 0, 1, 256), ((4, 1), -1, 3, 256)])
def test_cost_is_the_sum_of_three_truncated_terms(shape, min_disparity, num_disparities, reach):
    pair = random_pair(shape, reach=reach)
    volume = robust_cost_volume(pair, min_disparity, num_disparities)
    expected = scanline_reference.robust_cost(
        pair.left, pair.right, min_disparity, num_disparities, COST_UNIT)
    assert volume.dtype == np.uint8
    assert volume.shape[2] % DEPTH_STEP == 0
    assert np.all(volume[:, :, num_disparities:] == PADDING)
    volume = volume[:, :, :num_disparities]
    # Kept in eight bits: about one step of 1 / COST_UNIT off.
    assert np.abs(volume - expected).max() <= 1.25
    partner = np.arange(shape[1])[:, None] - min_disparity - np.arange(num_disparities)
    outside = (partner < 0) | (partner >= shape[1])
    assert np.all(volume[:, outside] == OUT_OF_VIEW)


def test_cost_is_zero_for_equal_views():
    left = np.random.default_rng(2).integers(0, 256, (6, 8, 3), dtype=np.uint8)
    assert robust_cost_volume(StereoPair(left, left), 0, 1)[..., 0].max() == 0


def test_cost_is_twice_the_unit_where_all_terms_are_truncated():
    ramp = np.tile(np.arange(0, 200, 40, dtype=np.uint8), (5, 1))
    peak, pit = ramp.copy(), np.full((5, 5), 50, np.uint8)
    peak[2, 2], pit[2, 2] = 255, 0
    worst = robust_cost_volume(StereoPair(peak, pit), 0, 1)[2, 2, 0]
    assert 2 * COST_UNIT - 1 <= worst <= 2 * COST_UNIT


@pytest.mark.parametrize('first, count', [(40, 5), (-60, 7), (9, 1), (-9, 1), (200, 40)])
def test_a_range_outside_the_view_costs_the_constant(first, count):
    volume = robust_cost_volume(random_pair((4, 9)), first, count)
    assert np.all(volume[:, :, :count] == OUT_OF_VIEW)


def test_grey_images_cost_what_three_equal_channels_cost():
    grey = random_pair((5, 9), reach=60)
    color = StereoPair(*(np.repeat(view[..., None], 3, 2) for view in (grey.left, grey.right)))
    np.testing.assert_array_equal(robust_cost_volume(grey, 0, 5), robust_cost_volume(color, 0, 5))


@pytest.mark.compiled
@pytest.mark.parametrize('threads', [2, 3, 64])
def test_bands_do_not_change_the_cost(threads):
    pair = random_pair((13, 17, 3), reach=80)
    np.testing.assert_array_equal(
        robust_cost_volume(pair, 0, 9, threads), robust_cost_volume(pair, 0, 9))

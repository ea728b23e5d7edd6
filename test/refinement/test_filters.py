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

"""Every filter against its slow version, and what all of them do with holes."""

from dataclasses import replace

import filter_reference
import numpy as np
import pytest

from stereo_refine_ros.params import FilterParams
from stereo_refine_ros.params import FILTERS as FILTER_NAMES
from stereo_refine_ros.refinement.filters import apply_filter, FILTERS
from stereo_refine_ros.refinement.weighted_median import weighted_median

PARAMS = FilterParams(radius=2, sigma_color=20.0, sigma_space=2.0, sigma_disparity=3.0)


def scene(shape=(9, 11), channels=3, holes=0.2, seed=1):
    """Make a random map between 5 and 15 px with holes, and a random guide."""
    generator = np.random.default_rng(seed)
    values = generator.uniform(5, 15, shape).astype(np.float32)
    values[generator.random(shape) < holes] = np.nan
    size = shape if channels == 1 else (*shape, channels)
    return values, generator.integers(80, 140, size, dtype=np.uint8)


def run(method, values, guide, **changes):
    return apply_filter(values, guide, replace(PARAMS, method=method, **changes))


def test_every_name_of_the_parameter_has_a_filter():
    assert tuple(FILTERS) == FILTER_NAMES


def test_box_is_the_mean_of_the_valid_pixels():
    values, guide = scene()
    np.testing.assert_allclose(
        run('box', values, guide), filter_reference.box(values, 2), rtol=1e-5)


@pytest.mark.parametrize('channels', [1, 3])
def test_trilateral_is_the_naive_one_up_to_its_tables(channels):
    values, guide = scene(channels=channels)
    expected = filter_reference.trilateral(values, guide, 2, 20.0, 2.0, 3.0)
    np.testing.assert_allclose(run('trilateral', values, guide), expected, atol=0.03)


def test_guided_is_the_naive_one():
    values, guide = scene(channels=1)
    expected = filter_reference.guided(values, guide, 2, 0.01)
    np.testing.assert_allclose(run('guided', values, guide), expected, atol=1e-3)


@pytest.mark.parametrize('channels', [1, 3])
@pytest.mark.parametrize('radius', [1, 3])
def test_weighted_median_is_within_its_bound(channels, radius):
    values, guide = scene(channels=channels)
    result = run('weighted_median', values, guide, radius=radius)
    low, high = filter_reference.weighted_median_range(values, guide, radius, 20.0, 2.0, 0.02)
    valid = np.isfinite(values)
    assert np.array_equal(np.isfinite(result), valid)
    assert np.all(result[valid] >= low[valid] - 1 / 16 - 1e-4)
    assert np.all(result[valid] <= high[valid] + 1 / 16 + 1e-4)


def test_weighted_median_does_not_cross_an_edge_of_the_guide():
    values = np.full((12, 200), 10, np.float32)
    guide = np.full((12, 200), 50, np.uint8)
    values[:, 130:], guide[:, 130:] = 30, 200
    noisy = values.copy()
    noisy[::3, ::3] += 7
    np.testing.assert_array_equal(run('weighted_median', noisy, guide, radius=3), values)


def test_weighted_median_keeps_a_value_that_is_the_median_bit_for_bit():
    values = np.full((5, 5), 3.14159, np.float32)
    values[0, 0] = 9
    result = run('weighted_median', values, np.zeros((5, 5), np.uint8))
    assert np.all(result[1:, 1:] == np.float32(3.14159))


def test_weighted_median_bands_do_not_change_it():
    values, guide = scene((6, 140))
    one, three = (weighted_median(values, guide, 2, 20.0, 2.0, n) for n in (1, 3))
    np.testing.assert_array_equal(one, three)


def test_weighted_median_of_a_wide_window_is_near_the_exact_one():
    generator = np.random.default_rng(2)
    values = generator.normal(20, 1, (32, 32)).astype(np.float32)
    guide = np.zeros((32, 32), np.uint8)
    result = weighted_median(values, guide, 15, np.inf, np.inf)
    assert abs(result[16, 16] - np.median(values[1:32, 1:32])) < 0.4


def test_median_is_that_of_the_valid_pixels():
    values, guide = scene(holes=0.3)
    result = run('median', values, guide)
    middle = filter_reference.filter_windows(
        values, 2, lambda _, near: sorted(values[p] for p in near)[len(near) // 2])
    np.testing.assert_allclose(result, middle, atol=1 / 16 + 1e-4)


def test_median_without_holes_is_exact_inside():
    values, guide = scene(holes=0)
    result = run('median', values, guide, radius=1)
    assert result[4, 4] == np.median(values[3:6, 3:6])


def test_bilateral_smooths_a_surface_and_keeps_a_step():
    values = np.full((10, 20), 10, np.float32)
    values[:, 10:] = 40
    noise = np.random.default_rng(3).normal(0, 0.5, values.shape).astype(np.float32)
    result = run('bilateral', values + noise, np.zeros(values.shape, np.uint8))
    assert np.abs(result - values).mean() < 0.5 * np.abs(noise).mean()
    assert result[:, 9].max() < 12 and result[:, 10].min() > 38


@pytest.mark.parametrize('method', FILTER_NAMES)
def test_a_hole_stays_a_hole_and_pollutes_nothing(method):
    guide = np.full((9, 9, 3), 90, np.uint8)
    values = np.full((9, 9), 12.5, np.float32)
    values[2:5, 3:6] = np.nan
    values[0, 0] = np.nan
    before = values.copy()
    result = run(method, values, guide)
    assert result.dtype == np.float32 and result is not values
    np.testing.assert_array_equal(values, before)
    np.testing.assert_allclose(result, before, rtol=1e-5)


@pytest.mark.parametrize('method', FILTER_NAMES)
def test_a_map_of_holes_and_a_single_pixel_come_back(method):
    empty = np.full((4, 5), np.nan, np.float32)
    assert np.isnan(run(method, empty, np.zeros((4, 5), np.uint8))).all()
    one = np.full((1, 1), 7.25, np.float32)
    result = run(method, one, np.zeros((1, 1, 3), np.uint8), radius=5)
    np.testing.assert_allclose(result, 7.25, rtol=1e-5)


def test_unknown_method_and_wrong_guide_are_refused():
    values = np.zeros((4, 5), np.float32)
    with pytest.raises(ValueError, match="'magic' is none of none, box"):
        run('magic', values, np.zeros((4, 5), np.uint8))
    with pytest.raises(ValueError, match=r'guide: expected shape \(4, 5\), got \(5, 4\)'):
        run('box', values, np.zeros((5, 4), np.uint8))


def test_whole_disparities_stay_whole_under_the_weighted_median():
    generator = np.random.default_rng(3)
    values = generator.integers(3, 30, (12, 14)).astype(np.float32)
    values[0, 0] = 3.96
    guide = generator.integers(80, 140, (12, 14), dtype=np.uint8)
    result = run('weighted_median', values, guide)[2:, 2:]
    np.testing.assert_array_equal(result, np.rint(result))


def test_the_weighted_median_holds_over_its_whole_range():
    values = np.full((6, 5), 1990, np.float32)
    values[0, 0], values[:, 2] = 0, 700
    result = weighted_median(values, np.zeros((6, 5), np.uint8), 1, np.inf, np.inf)
    assert set(np.rint(result).reshape(-1).tolist()) <= {0.0, 700.0, 1990.0}
    assert np.all(result[2:, 3:] == 1990) and np.all(result[2:, 0] == 1990)

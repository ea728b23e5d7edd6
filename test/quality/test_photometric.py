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

"""Warping the right view by known disparities."""

import math

import numpy as np
import pytest

from stereo_refine_ros.quality.photometric import (
    compare_photometric, fit_exposure, visible_pixels, warp_right)
from stereo_refine_ros.types import StereoPair


def shifted_pair(disparity=3, shape=(24, 40)):
    """Make a pair of one fronto-parallel plane: what left shows at x, right shows at x - d."""
    rng = np.random.default_rng(5)
    wide = rng.integers(0, 256, (shape[0], shape[1] + disparity), dtype=np.uint8)
    return StereoPair(wide[:, :shape[1]].copy(), wide[:, disparity:].copy())


def test_warp_reads_the_match_and_says_what_is_seen():
    right = np.array([[0, 10, 20, 30, 40]], np.uint8)
    values = np.array([[0, 0.5, 3, np.nan, -1]], np.float32)
    warped, seen = warp_right(right, values)
    np.testing.assert_array_equal(seen, [[True, True, False, False, False]])
    np.testing.assert_array_equal(warped, [[0, 5, 0, 0, 0]])


def test_warp_matches_the_naive_warp():
    rng = np.random.default_rng(2)
    right = rng.integers(0, 256, (9, 15), dtype=np.uint8)
    values = rng.uniform(-2, 18, right.shape).astype(np.float32)
    values[rng.random(values.shape) < 0.2] = np.nan
    warped, seen = warp_right(right, values)
    for y, x in np.ndindex(right.shape):
        column = x - values[y, x]
        assert seen[y, x] == (not np.isnan(column) and 0 <= column <= 14)
        exact = np.interp(column, np.arange(15), right[y]) if seen[y, x] else 0
        assert abs(warped[y, x] - exact) <= 0.501


def test_last_column_is_seen():
    warped, seen = warp_right(np.full((2, 4), 9, np.uint8), np.full((2, 4), -1, np.float32))
    np.testing.assert_array_equal(seen, [[True, True, True, False]] * 2)
    np.testing.assert_array_equal(warped[:, :3], 9)


def flat(pair, disparity):
    return np.full(pair.shape, disparity, np.float32)


def test_true_disparity_is_perfect_and_a_wrong_one_is_not():
    pair = shifted_pair()
    before, after = compare_photometric(pair, flat(pair, 5), flat(pair, 3))
    assert after.psnr == math.inf
    assert after.ssim == pytest.approx(1, abs=1e-6)
    # The fit goes by both maps, half of whose matches are exact: residuals are cut at 3 levels.
    assert before.psnr == pytest.approx(10 * math.log10(255 ** 2 / 9), abs=0.2)
    assert before.ssim < after.ssim


def test_both_maps_are_measured_over_the_pixels_that_both_know():
    pair = shifted_pair()
    before, after = flat(pair, 3), flat(pair, 3)
    before[:, 30:] = np.nan
    after[:, 30:] = 5  # wrong, but the first map says nothing there
    for quality in compare_photometric(pair, before, after):
        assert quality.psnr == math.inf
    after[:, 10:12] = np.nan
    before[:, 10:12] = 4  # wrong, but the second map says nothing there
    assert compare_photometric(pair, before, after)[0].psnr == math.inf


def test_what_the_second_map_covers_does_not_count():
    pair = shifted_pair()
    left = pair.left.copy()
    left[:, 10] = 255 - left[:, 10]  # seen by the left view alone
    before, after = flat(pair, 3), flat(pair, 3)
    after[:, 14] = 7  # matches column 7 of the right view, as column 10 does
    first, second = compare_photometric(StereoPair(left, pair.right), before, after)
    assert first.psnr == math.inf
    assert second.psnr < math.inf  # the right view does not show column 14 at column 7
    assert compare_photometric(StereoPair(left, pair.right), before, before)[0].psnr < math.inf


def test_visible_pixels_by_hand():
    values = np.array([[1, 1, 1, 1, 4, 4, 1, 1, np.nan]], np.float32)
    # Columns -1, 0, 1, 2, 0, 1, 5, 6: what lies at 0..2 is covered by the 4s at 0 and 1.
    assert visible_pixels(values).tolist() == [
        [False, False, False, False, True, True, True, True, False]]


def test_a_slanted_surface_covers_nothing_of_itself():
    slanted = np.linspace(0, 9, 20, dtype=np.float32)[None]  # 0.47 px a column
    assert visible_pixels(slanted).all()


def naive_visible(values):
    out = np.zeros(values.shape, bool)
    for y, row in enumerate(values):
        column = np.arange(row.size, dtype=np.float32) - row
        inside = (column >= 0) & (column <= row.size - 1)
        at = np.floor(np.where(inside, column, 0) + np.float32(0.5)).astype(int)
        for x in np.flatnonzero(inside):
            near = inside & (np.abs(at - at[x]) <= 1)
            out[y, x] = row[x] >= row[near].max() - 2
    return out


def test_visible_pixels_match_the_naive_search():
    rng = np.random.default_rng(4)
    values = rng.uniform(-2, 12, (12, 30)).astype(np.float32)
    values[rng.random(values.shape) < 0.2] = np.nan
    np.testing.assert_array_equal(visible_pixels(values), naive_visible(values))


def test_exposure_is_found_in_spite_of_wrong_matches():
    rng = np.random.default_rng(6)
    right = rng.integers(20, 230, 4000).astype(np.uint8)
    left = np.rint(1.1 * right - 12 + rng.normal(0, 1, right.size)).clip(0, 255).astype(np.uint8)
    left[:600] = rng.integers(0, 256, 600)
    found = fit_exposure(left, right)
    assert found.gain == pytest.approx(1.1, abs=0.01)
    assert found.offset == pytest.approx(-12, abs=1)
    assert 1.0 <= found.spread < 2.0
    assert found.apply(np.array([100], np.uint8)) == pytest.approx(98, abs=0.3)


def test_levels_that_do_not_vary_give_an_offset_alone():
    found = fit_exposure(np.full(9, 130, np.uint8), np.full(9, 100, np.uint8))
    assert (found.gain, found.offset, found.spread) == (1.0, 30.0, 1.0)


def test_a_darker_view_is_no_fault_of_the_map():
    pair = shifted_pair()
    darker = StereoPair(pair.left, np.rint(0.8 * pair.right + 5).astype(np.uint8))
    true, wrong = flat(pair, 3), flat(pair, 3)
    wrong[:, 25:] = 8
    before, after = compare_photometric(darker, wrong, true)
    assert after.psnr > 50  # what rounding leaves
    assert after.ssim > 0.9999
    assert before.psnr < 43
    assert before.ssim < after.ssim


def test_few_outliers_do_not_decide():
    # An outline's mixed pixels: any residual beyond three spreads (here 1 level) counts as 3.
    left = np.full((12, 40), 100, np.uint8)
    right = left.copy()
    right[:, 7] = 250
    before, after = compare_photometric(
        StereoPair(left, right), np.zeros((12, 40), np.float32), np.zeros((12, 40), np.float32))
    assert before == after
    assert after.psnr == pytest.approx(10 * math.log10(255 ** 2 / (9 / 40)))


def test_colour_is_compared_in_grey():
    grey = shifted_pair()
    colour = StereoPair(*(np.repeat(image[..., None], 3, axis=2)
                          for image in (grey.left, grey.right)))
    assert compare_photometric(colour, flat(grey, 2), flat(grey, 3)) == compare_photometric(
        grey, flat(grey, 2), flat(grey, 3))


def test_nothing_to_compare_gives_nan():
    pair = shifted_pair()
    known, empty = flat(pair, 3), flat(pair, np.nan)
    for views, before in ((pair, empty), (StereoPair(pair.left, None), known)):
        for quality in compare_photometric(views, before, known):
            assert math.isnan(quality.psnr)
            assert math.isnan(quality.ssim)

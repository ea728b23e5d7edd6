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

from stereo_refine_ros.quality.photometric import photometric_quality, warp_right
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


def test_true_disparity_is_perfect():
    pair = shifted_pair()
    psnr, ssim = photometric_quality(pair, np.full(pair.shape, 3, np.float32))
    assert psnr == math.inf
    assert ssim == pytest.approx(1, abs=1e-6)


def test_wrong_disparity_is_worse_and_holes_do_not_count():
    pair = shifted_pair()
    values = np.full(pair.shape, 3, np.float32)
    values[:, 30:] = 5
    psnr, ssim = photometric_quality(pair, values)
    assert psnr < 20
    assert ssim < 0.9
    values[:, 30:] = np.nan
    assert photometric_quality(pair, values)[0] == math.inf


def test_colour_is_compared_in_grey():
    grey = shifted_pair()
    colour = StereoPair(*(np.repeat(image[..., None], 3, axis=2)
                          for image in (grey.left, grey.right)))
    values = np.full(grey.shape, 2, np.float32)
    assert photometric_quality(colour, values) == pytest.approx(
        photometric_quality(grey, values), abs=1e-3)


def test_nothing_to_compare_gives_nan():
    pair = shifted_pair()
    empty = np.full(pair.shape, np.nan, np.float32)
    assert all(math.isnan(figure) for figure in photometric_quality(pair, empty))
    alone = StereoPair(pair.left, None)
    assert all(math.isnan(figure) for figure in photometric_quality(alone, empty))

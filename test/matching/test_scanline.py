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

"""The scanline matcher against dynamic programming written out, pixel by pixel."""

import cv2
import numpy as np
import pytest
import scanline_reference as slow

from stereo_refine_ros.images import to_grey
from stereo_refine_ros.matching.scanline import match_scanline, scan
from stereo_refine_ros.matching.scanline_winners import WIDEST
from stereo_refine_ros.matching.scratch import scratch
from stereo_refine_ros.params import MatchingParams
from stereo_refine_ros.types import StereoPair


def patchy_pair(shape, shift=3, seed=0):
    """Patches with sharp and with soft edges; the right view is shifted and noisy."""
    rng = np.random.default_rng(seed)
    height, width, *channels = shape
    patches = rng.integers(0, 256, (-(-height // 3), -(-(width + 8) // 3), *channels))
    wide = np.kron(patches, np.ones((3, 3, *[1] * len(channels)), int))[:height, :width + 8]
    views = [np.clip(wide + rng.integers(-9, 10, wide.shape), 0, 255).astype(np.uint8)
             for _ in range(2)]
    return StereoPair(np.ascontiguousarray(views[0][:, 8:8 + width]),
                      np.ascontiguousarray(views[1][:, 8 + shift:8 + shift + width])
                      if shift <= 0 else np.ascontiguousarray(views[1][:, 8 - shift:][:, :width]))


def slow_scan(pair, min_disparity, num_disparities, edge_step=20):
    views = [slow.features(to_grey(view)) for view in (pair.left, pair.right)]
    everywhere = range(min_disparity, min_disparity + num_disparities)
    counts = slow.counted(pair.left, edge_step)
    costs = slow.cost_volume(*views, counts, lambda y, x: everywhere)
    return slow.finish(slow.path_sums(pair.left, costs, edge_step), costs, pair.shape)


def assert_same(found, disparity, uniqueness, right):
    np.testing.assert_allclose(found.disparity, disparity, rtol=1e-6)
    np.testing.assert_allclose(found.uniqueness, uniqueness, rtol=1e-6)
    np.testing.assert_array_equal(found.right, right)


@pytest.mark.parametrize('shape, min_disparity, num_disparities', [
    ((24, 40), 0, 16), ((10, 22, 3), -6, 13), ((6, 12, 3), 2, 40), ((5, 9), -40, 70),
    ((1, 30), 0, 8), ((14, 1), -1, 3), ((1, 1), 0, 1), ((3, 8), -300, 20), ((3, 8), 500, 4),
    ((3, 6), -20, 129), ((2, 5), -100, 256)])
def test_every_map_is_what_four_paths_make(shape, min_disparity, num_disparities):
    pair = patchy_pair(shape, shift=-3 if min_disparity < -5 else 3)
    assert_same(scan(pair, min_disparity, num_disparities),
                *slow_scan(pair, min_disparity, num_disparities))


@pytest.mark.compiled
def test_strips_and_bands_begin_where_the_reference_says():
    pair = patchy_pair((4 * 48 + 30, 9))
    assert_same(scan(pair, 0, 5), *slow_scan(pair, 0, 5))


@pytest.mark.parametrize('edge_step', [0, 7.5, 60, 300])
def test_the_least_step_of_an_edge_can_be_given(edge_step):
    pair = patchy_pair((7, 14, 3))
    assert_same(scan(pair, 0, 8, edge_step=edge_step), *slow_scan(pair, 0, 8, edge_step))


def test_three_equal_channels_are_a_grey_image():
    pair = patchy_pair((12, 20))
    colour = StereoPair(*[cv2.cvtColor(view, cv2.COLOR_GRAY2BGR)
                          for view in (pair.left, pair.right)])
    grey = scan(pair, 0, 8)
    assert_same(scan(colour, 0, 8), grey.disparity, grey.uniqueness, grey.right)


@pytest.mark.parametrize('threads', [2, 3])
def test_threads_do_not_change_a_bit(threads):
    pair = patchy_pair((23, 31, 3))
    once, again = scan(pair, -2, 9), scan(pair, -2, 9, threads)
    assert_same(again, once.disparity, once.uniqueness, once.right)


@pytest.mark.parametrize('min_disparity', [-9, 0, 12])
def test_what_lies_around_the_views_and_in_reused_memory_is_not_read(min_disparity, monkeypatch):
    pair = patchy_pair((6, 11))
    results = []
    for seed in range(2):
        rng = np.random.default_rng(seed)

        def noisy(size, rng=rng):
            with scratch(size) as array:
                array[:] = rng.integers(0, 256, size)
            return scratch(size)
        monkeypatch.setattr('stereo_refine_ros.matching.scanline.scratch', noisy)
        results.append(scan(pair, min_disparity, 7))
    monkeypatch.undo()
    for found in results:
        assert_same(found, *slow_scan(pair, min_disparity, 7))


def test_a_shifted_view_is_matched_by_its_shift():
    rng = np.random.default_rng(4)
    wide = cv2.GaussianBlur(rng.integers(0, 256, (10, 34, 3), dtype=np.uint8), (0, 0), 0.8)
    pair = StereoPair(np.ascontiguousarray(wide[:, :30]), np.ascontiguousarray(wide[:, 4:]))
    values = scan(pair, 0, 8).disparity
    assert np.abs(values[:, 4:] - 4).max() < 0.75
    swapped = scan(StereoPair(pair.right, pair.left), -7, 8).disparity
    assert np.abs(swapped[:, :26] + 4).max() < 0.75


def test_equal_costs_take_the_least_disparity():
    grey = np.full((2, 6), 90, np.uint8)
    found = scan(StereoPair(grey, grey), 0, 3)
    assert found.disparity.tolist() == found.right.tolist() == [[0.0] * 6] * 2


def test_sums_do_not_overflow_at_the_greatest_contrast():
    board = (np.indices((12, 30)).sum(0) % 2 * 255).astype(np.uint8)
    pair = StereoPair(board, 255 - board)
    assert_same(scan(pair, 0, 20), *slow_scan(pair, 0, 20))


def test_a_match_is_the_scan_without_what_anything_fits():
    pair = patchy_pair((12, 20, 3), seed=3)
    match = match_scanline(pair, MatchingParams('scanline', -2, 7))
    found = scan(pair, -2, 7)
    expected = np.where(found.uniqueness > 0, found.disparity, np.float32(np.nan))
    np.testing.assert_array_equal(match.disparity.values, expected)
    np.testing.assert_array_equal(match.scan.right, found.right)
    assert (match.disparity.min_disparity, match.disparity.num_disparities) == (-2, 7)


def test_one_view_is_refused():
    with pytest.raises(ValueError, match='right image'):
        scan(StereoPair(np.zeros((4, 4), np.uint8), None), 0, 4)


def test_views_wider_than_a_claim_can_tell_are_refused():
    wide = np.zeros((1, WIDEST + 1), np.uint8)
    with pytest.raises(ValueError, match=f'at most {WIDEST} pixels wide, not {WIDEST + 1}'):
        scan(StereoPair(wide, wide), 0, 4)

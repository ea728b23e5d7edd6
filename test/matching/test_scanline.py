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

"""Scanline optimisation against dynamic programming written out, pixel by pixel."""

import cv2
import numpy as np
import pytest
import scanline_reference

from stereo_refine_ros.matching import scanline
from stereo_refine_ros.matching.robust_cost import COST_UNIT
from stereo_refine_ros.matching.scanline import gather_evidence, match_scanline
from stereo_refine_ros.params import MatchingParams
from stereo_refine_ros.types import StereoPair

# The largest island of the pictures below.
ISLAND = 6


@pytest.fixture(autouse=True)
def wrapping_allowed():
    """Let unsigned scalars wrap round where the kernels run as plain Python."""
    with np.errstate(over='ignore'):
        yield


def params(min_disparity=0, num_disparities=6):
    return MatchingParams('scanline', min_disparity, num_disparities)


def blocky_pair(shape=(7, 11, 3), seed=0, shift=2):
    """Patches with sharp and with soft edges; the right view is shifted and noisy."""
    rng = np.random.default_rng(seed)
    patches = rng.integers(0, 256, (-(-shape[0] // 3), -(-(shape[1] + 8) // 3), *shape[2:]))
    wide = np.kron(patches, np.ones((3, 3, *[1] * len(shape[2:])), int))
    wide = wide[:shape[0], :shape[1] + 8]
    noisy = [np.clip(wide + rng.integers(-12, 13, wide.shape), 0, 255).astype(np.uint8)
             for _ in range(2)]
    return StereoPair(np.ascontiguousarray(noisy[0][:, :shape[1]]),
                      np.ascontiguousarray(noisy[1][:, shift:shift + shape[1]]))


def penalty(left_edge, right_edge, is_down):
    """Return P1 and P2 of a step as the eight-bit costs have them."""
    both, one, none = scanline._EDGE_FACTORS
    least, flat = (both, one) if left_edge else (one, none)
    sizes = np.array(scanline._PENALTIES[is_down]) * COST_UNIT
    small = np.rint(sizes * least).astype(int)
    return small if right_edge else small + np.rint(sizes * flat - sizes * least).astype(int)


@pytest.mark.parametrize('is_down, sizes', [(False, [1.75, 4.5]), (True, [1.0, 3.5])])
def test_penalties_shrink_where_a_view_shows_an_edge(is_down, sizes):
    full = np.array(sizes) * COST_UNIT
    assert np.abs(penalty(False, False, is_down) - full).max() <= 0.5
    assert np.abs(penalty(True, True, is_down) - 0.1 * full).max() <= 0.5
    assert np.abs(penalty(True, False, is_down) - 0.15 * full).max() <= 1.0
    assert np.abs(penalty(False, True, is_down) - 0.15 * full).max() <= 1.0


@pytest.mark.parametrize('shape, min_disparity, num_disparities', [
    ((7, 11, 3), 0, 6), ((6, 9), 0, 5), ((5, 9, 3), -3, 6), ((5, 8), 2, 4), ((4, 5, 3), -8, 20),
    ((1, 1), 0, 1), ((1, 6, 3), 0, 4), ((6, 1), -1, 3), ((3, 4), 30, 3),
    ((3, 5), 0, 32), ((3, 6, 3), -4, 33), ((3, 6), -40, 40)])
def test_totals_are_the_sum_of_four_paths(shape, min_disparity, num_disparities):
    pair = blocky_pair(shape)
    evidence, winners, subpixel = gather_evidence(
        pair, params(min_disparity, num_disparities))
    expected = scanline_reference.path_sums(
        pair.left, pair.right, evidence.cost[:, :, :num_disparities], min_disparity,
        scanline._EDGE_THRESHOLD, penalty)
    assert (evidence.min_disparity, evidence.num_disparities) == (min_disparity, num_disparities)
    np.testing.assert_array_equal(evidence.total[:, :, :num_disparities], expected)
    np.testing.assert_array_equal(evidence.least, expected.min(axis=2))
    np.testing.assert_array_equal(winners, expected.argmin(axis=2))
    np.testing.assert_array_equal(
        evidence.right, scanline_reference.right_winners(expected, min_disparity))
    offsets = [scanline_reference.subpixel(expected[p], int(winners[p]))
               for p in np.ndindex(winners.shape)]
    np.testing.assert_allclose(subpixel.reshape(-1), offsets, rtol=1e-6)


def test_right_winners_prefer_the_smaller_disparity_of_equals():
    grey = np.full((2, 6), 90, np.uint8)
    evidence, winners, _ = gather_evidence(StereoPair(grey, grey), params(0, 3))
    assert evidence.right.tolist() == [[0] * 6] * 2
    assert winners.tolist() == [[0.0] * 6] * 2


def test_right_pixels_that_no_left_pixel_reaches_are_marked():
    evidence, _, _ = gather_evidence(blocky_pair((3, 8)), params(3, 2))
    assert np.all(evidence.right[:, -3:] == -1)
    assert np.all(evidence.right[:, :-3] >= 0)


@pytest.mark.parametrize('first, count', [(1, 5), (-5, 11), (0, 1), (2, 2), (7, 30)])
def test_every_disparity_lies_in_the_range_asked_for(first, count):
    match = match_scanline(blocky_pair((13, 16, 3), shift=3), params(first, count))
    values = match.disparity.values[match.disparity.valid]
    assert match.disparity.values.shape == (13, 16)
    assert values.size == 0 or first <= values.min() <= values.max() < first + count


@pytest.mark.parametrize('min_disparity', [0, -2])
def test_the_match_is_checked_left_against_right_and_has_no_islands(min_disparity, monkeypatch):
    monkeypatch.setattr(scanline, '_ISLANDS', 12 * 20 // ISLAND)
    pair = blocky_pair((12, 20, 3), seed=3)
    match = match_scanline(pair, params(min_disparity, 7))
    total = match.evidence.total[:, :, :7].astype(int)
    winners, right = total.argmin(axis=2), match.evidence.right
    stable = np.zeros(winners.shape, bool)
    for (y, x), winner in np.ndenumerate(winners):
        u = x - min_disparity - winner
        stable[y, x] = (0 <= u < 20 and right[y, u] >= 0 and abs(right[y, u] - winner) <= 1)
    islands = scanline_reference.islands(winners, stable, ISLAND)
    assert islands.any() and not islands.all()
    np.testing.assert_array_equal(match.disparity.valid, stable & ~islands)
    for y, x in np.argwhere(stable & ~islands):
        expected = scanline_reference.subpixel(total[y, x], winners[y, x]) + min_disparity
        assert match.disparity.values[y, x] == pytest.approx(expected, rel=1e-6)


def test_a_shifted_view_is_matched_by_its_shift():
    rng = np.random.default_rng(4)
    wide = cv2.GaussianBlur(rng.integers(0, 256, (10, 34, 3), dtype=np.uint8), (0, 0), 0.8)
    pair = StereoPair(np.ascontiguousarray(wide[:, :30]), np.ascontiguousarray(wide[:, 4:]))
    values = match_scanline(pair, params(0, 8)).disparity.values
    assert np.abs(values[:, 4:] - 4).max() < 0.75
    swapped = match_scanline(StereoPair(pair.right, pair.left), params(-7, 8)).disparity.values
    assert np.abs(swapped[:, :26] + 4).max() < 0.75


@pytest.mark.compiled
def test_sums_do_not_overflow_at_the_greatest_contrast():
    board = (np.indices((40, 60)).sum(0) % 2 * 255).astype(np.uint8)
    total = gather_evidence(StereoPair(board, 255 - board), params(0, 40))[0].total
    largest = 4 * (2 * COST_UNIT + round(scanline._PENALTIES[0][1] * COST_UNIT))
    assert 0 <= total[:, :, :40].min() <= total[:, :, :40].max() <= largest
    # The padding is never the least.
    assert total[:, :, 40:].min() > largest


@pytest.mark.compiled
@pytest.mark.parametrize('threads', [2, 3, 50])
def test_bands_do_not_change_the_evidence(threads):
    pair = blocky_pair((23, 31, 3))
    once, winners, subpixel = gather_evidence(pair, params(-2, 9))
    again, winners_again, subpixel_again = gather_evidence(pair, params(-2, 9), threads)
    np.testing.assert_array_equal(again.cost, once.cost)
    np.testing.assert_array_equal(again.total[:, :, :9], once.total[:, :, :9])
    np.testing.assert_array_equal(again.least, once.least)
    np.testing.assert_array_equal(again.right, once.right)
    np.testing.assert_array_equal(winners_again, winners)
    np.testing.assert_array_equal(subpixel_again, subpixel)

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

"""What two matches of a pair say, laid out on either grid in pixels of the full image."""

import numpy as np
import pytest

from stereo_refine_ros.images import halve
from stereo_refine_ros.levels import to_grid
from stereo_refine_ros.matching import compute_match, find_match
from stereo_refine_ros.params import MatchingParams
from stereo_refine_ros.refinement.evidence import gather_evidence, match_half
from stereo_refine_ros.types import StereoPair

pytestmark = pytest.mark.compiled  # the matcher's vector steps
SHAPE = (40, 73)
SHIFT = 6
PARAMS = MatchingParams('scanline', 0, 21)


def gather(pair, match, params, scale, threads=1):
    given = to_grid(match.disparity.values, scale)
    return gather_evidence(pair, match, given, match_half(pair, params), params, scale, threads)


@pytest.fixture(scope='module')
def pair():
    rng = np.random.default_rng(7)
    texture = rng.integers(0, 256, (SHAPE[0], SHAPE[1] + SHIFT, 3), dtype=np.uint8)
    return StereoPair(np.ascontiguousarray(texture[:, :SHAPE[1]]),
                      np.ascontiguousarray(texture[:, SHIFT:]))


@pytest.mark.parametrize('scale', [1, 2])
def test_disparities_are_those_of_the_full_image_on_either_grid(pair, scale):
    match = compute_match(pair, PARAMS)
    evidence = gather(pair, match, PARAMS, scale)
    grid = tuple(-(-size // scale) for size in SHAPE)
    assert evidence.has_right and evidence.scale == scale
    assert evidence.image.shape[:2] == grid
    for name in ('fine', 'coarse', 'uniqueness', 'right'):
        values = getattr(evidence, name)
        assert values.shape == grid and values.dtype == np.float32, name
    for values in (evidence.fine, evidence.coarse, evidence.right):
        known = values[np.isfinite(values)]
        assert known.size > 0.6 * values.size
        assert np.median(known) == pytest.approx(SHIFT, abs=0.3)
    assert 0 <= evidence.uniqueness.min() <= evidence.uniqueness.max() <= 2
    np.testing.assert_array_equal(evidence.image, pair.left if scale == 1 else halve(pair.left))
    np.testing.assert_array_equal(evidence.fine, to_grid(match.disparity.values, scale))


def test_the_range_may_begin_below_zero_and_be_odd(pair):
    swapped = StereoPair(pair.right, pair.left)
    params = MatchingParams('scanline', -9, 7)
    for scale in (1, 2):
        evidence = gather(swapped, compute_match(swapped, params), params, scale)
        for values in (evidence.fine, evidence.coarse, evidence.right):
            assert np.nanmedian(values) == pytest.approx(-SHIFT, abs=0.3)


@pytest.mark.parametrize('scale', [1, 2])
def test_the_last_disparity_of_the_range_is_seen_at_half_resolution_too(pair, scale):
    params = MatchingParams('scanline', 0, SHIFT + 1)
    evidence = gather(pair, compute_match(pair, params), params, scale)
    assert np.nanmedian(evidence.coarse) == pytest.approx(SHIFT, abs=0.5)


@pytest.mark.parametrize('first, count', [(-7, 13), (-9, 7), (0, 16), (3, 1), (5, 2)])
def test_no_match_leaves_the_range(first, count):
    noise = np.random.default_rng(1).integers(0, 256, (2, 60, 90), dtype=np.uint8)
    params = MatchingParams('scanline', first, count)
    views = StereoPair(noise[0], noise[1])
    evidence = gather(views, compute_match(views, params), params, 1)
    for values in (evidence.fine, evidence.coarse):
        known = values[np.isfinite(values)]
        assert first <= known.min() <= known.max() <= first + count - 1


@pytest.mark.parametrize('scale', [1, 2])
def test_whatever_map_is_judged_the_witness_is_the_same(pair, scale):
    own = gather(pair, compute_match(pair, PARAMS), PARAMS, scale)
    noise = np.random.default_rng(0).uniform(0, 20, SHAPE).astype(np.float32)
    for match in (find_match(pair, noise, PARAMS),
                  compute_match(pair, MatchingParams('sgbm', 0, 21))):
        other = gather(pair, match, PARAMS, scale)
        for name in ('image', 'fine', 'coarse', 'uniqueness', 'right'):
            np.testing.assert_array_equal(getattr(other, name), getattr(own, name), name)


@pytest.mark.parametrize('scale', [1, 2])
def test_without_a_right_view_the_map_is_its_own_witness(pair, scale):
    given = np.full(SHAPE, 5, np.float32)
    given[:8] = np.nan
    left = StereoPair(pair.left, None)
    evidence = gather(left, find_match(left, given, PARAMS), PARAMS, scale)
    assert not evidence.has_right
    np.testing.assert_array_equal(evidence.fine, to_grid(given, scale))
    assert np.isnan(evidence.coarse).all() and np.isnan(evidence.right).all()
    assert np.all(evidence.uniqueness == 0)
    assert evidence.image.shape[:2] == evidence.fine.shape == evidence.coarse.shape


@pytest.mark.parametrize('threads', [2, 3])
def test_threads_change_no_bit(pair, threads):
    match = compute_match(pair, PARAMS)
    first, again = (gather(pair, match, PARAMS, 2, count) for count in (1, threads))
    for name in ('fine', 'coarse', 'uniqueness', 'right'):
        np.testing.assert_array_equal(getattr(again, name), getattr(first, name), name)


def test_plain_views_have_no_matches_but_the_shape_of_ones():
    plain = np.full((6, 9), 80, np.uint8)
    pair = StereoPair(plain, plain)
    evidence = gather(pair, compute_match(pair, PARAMS), PARAMS, 2)
    assert evidence.fine.shape == evidence.coarse.shape == (3, 5)
    assert not np.isinf(evidence.fine).any() and np.all(evidence.uniqueness >= 0)

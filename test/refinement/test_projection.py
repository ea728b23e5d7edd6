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

"""Planes to disparities, and the guarded choice among candidates, against slow versions."""

import numpy as np
import plane_reference
import pytest

from stereo_refine_ros.graph.pixel_graph import edge_weights
from stereo_refine_ros.graph.support import sweep
from stereo_refine_ros.graph.tuning import FADE
from stereo_refine_ros.matching.scanline import gather_evidence
from stereo_refine_ros.params import MatchingParams
from stereo_refine_ros.refinement import projection, tuning
from stereo_refine_ros.refinement.projection import choose_candidates, plane_disparities
from stereo_refine_ros.types import StereoPair

# Nothing that a matcher said: all of it filled.
FILLED = np.zeros((9, 14), np.bool_)


@pytest.fixture(autouse=True)
def wrapping_allowed():
    """Let unsigned scalars wrap round where the kernels run as plain Python."""
    with np.errstate(over='ignore'):
        yield


def problem(seed, shape=(9, 14), min_disparity=0):
    rng = np.random.default_rng(seed)
    views = rng.integers(0, 256, (2, *shape, 3), dtype=np.uint8)
    views[1, :, :-2] = views[0, :, 2:]
    pair = StereoPair(*views)
    evidence = gather_evidence(pair, MatchingParams('scanline', min_disparity, 7))[0]
    return evidence, edge_weights(pair.left), rng


def test_every_pixel_takes_the_plane_of_its_segment_within_the_range():
    rng = np.random.default_rng(0)
    labels = rng.integers(0, 4, (7, 8), dtype=np.int32)
    tilts = np.array([[0.5, 0.25, 1.0], [-2.0, 1.0, 3.0], [np.nan] * 3, [0.0, 0.0, 40.0]])
    bounds = np.tile([-1000.0, 1000.0], (4, 1))
    values = plane_disparities(labels, np.hstack([tilts, bounds]), -1.0, 9.0)
    assert values.dtype == np.float32
    for (y, x), label in np.ndenumerate(labels):
        expected = tilts[label] @ [x, y, 1.0]
        if label == 2:
            assert np.isnan(values[y, x])
        else:
            assert values[y, x] == np.float32(min(max(expected, -1.0), 9.0))


def test_planes_end_a_little_beyond_where_they_were_seen():
    labels = np.zeros((1, 30), np.int32)
    plane = np.array([[0.5, 0.0, 2.0, 5.0, 9.0]])
    values = plane_disparities(labels, plane, 0.0, 100.0)
    reach = tuning.EXTRAPOLATION
    expected = np.clip(0.5 * np.arange(30) + 2, 5 - reach, 9 + reach)
    np.testing.assert_allclose(values[0], expected, rtol=1e-6)
    assert values.max() == 9 + reach < 0.5 * 29 + 2


@pytest.mark.parametrize('inertia, is_trusted', [(0.0, False), (0.4, False), (1.0, True)])
@pytest.mark.parametrize('seed, min_disparity', [(0, 0), (1, -3), (2, 2), (3, 1), (4, 6)])
def test_the_candidate_with_the_most_votes_wins(seed, min_disparity, inertia, is_trusted):
    evidence, weights, rng = problem(seed, (9, 14), min_disparity)
    begin, planes_say = rng.uniform(min_disparity - 3, min_disparity + 9, (2, 9, 14)).astype(
        np.float32)
    begin[:4] = planes_say[:4] + np.float32(0.1)
    proposed = np.where(rng.random((9, 14)) < 0.2, np.float32(np.nan), planes_say)
    is_given = rng.random((9, 14)) < 0.5
    chosen = choose_candidates(
        proposed, begin, is_given, evidence, weights, inertia, is_trusted)
    filled = np.where(np.isnan(proposed), begin, proposed)
    gain = plane_reference.gain(evidence, filled, begin, is_given, inertia, is_trusted)
    votes = sweep(gain, weights, projection._VOTE_SIGMA)
    np.testing.assert_array_equal(chosen, np.where(votes >= 0, begin, filled))
    assert 0 < np.count_nonzero(chosen != begin) < chosen.size


def test_inertia_counts_only_where_something_given_is_uncontested():
    evidence, _, rng = problem(0)
    begin, proposed = rng.uniform(0, 6, (2, 9, 14)).astype(np.float32)
    is_given = rng.random((9, 14)) < 0.5
    rise = (plane_reference.gain(evidence, proposed, begin, is_given, 1.0)
            - plane_reference.gain(evidence, proposed, begin, is_given))
    assert set(np.rint(rise).reshape(-1).tolist()) == {0.0, 1.0}
    assert not rise[~is_given].any()
    assert not rise[plane_reference.is_hidden(evidence, begin)].any()


def test_what_is_trusted_is_worth_it_wherever_it_was_given():
    evidence, _, rng = problem(0)
    begin, proposed = rng.uniform(0, 6, (2, 9, 14)).astype(np.float32)
    is_given = rng.random((9, 14)) < 0.5
    rise = (plane_reference.gain(evidence, proposed, begin, is_given, 1.0, is_trusted=True)
            - plane_reference.gain(evidence, proposed, begin, is_given))
    differs = np.abs(proposed - begin) >= projection.ALIKE
    np.testing.assert_array_equal(np.rint(rise), is_given & differs)


def test_where_nothing_tells_candidates_apart_the_first_is_kept():
    evidence, weights, _ = problem(0)
    begin = np.full((9, 14), 2.0, np.float32)
    assert np.all(choose_candidates(
        begin + np.float32(0.2), begin, FILLED, evidence, weights) == begin)


def test_no_proposal_leaves_what_there_was():
    evidence, weights, rng = problem(1)
    begin = rng.uniform(0, 6, (9, 14)).astype(np.float32)
    holes = np.full((9, 14), np.nan, np.float32)
    kept = choose_candidates(holes, begin, FILLED, evidence, weights)
    np.testing.assert_array_equal(kept, begin)
    assert np.isnan(choose_candidates(holes, holes, FILLED, evidence, weights)).all()


def test_a_candidate_that_the_images_confirm_beats_one_that_they_refute():
    evidence, weights, _ = problem(2)
    right, wrong = (np.full((9, 14), d, np.float32) for d in (2.0, 5.0))
    inner = (slice(None), slice(6, None))
    for is_given in (FILLED, ~FILLED):
        for proposed, begin in ((right, wrong), (wrong, right)):
            chosen = choose_candidates(proposed, begin, is_given, evidence, weights)
            assert np.all(chosen[inner] == 2.0)


@pytest.mark.compiled
@pytest.mark.parametrize('threads', [2, 3])
def test_bands_do_not_change_the_choice(threads):
    evidence, weights, rng = problem(3)
    first, second = rng.uniform(0, 6, (2, 9, 14)).astype(np.float32)
    np.testing.assert_array_equal(
        choose_candidates(second, first, FILLED, evidence, weights, threads=threads),
        choose_candidates(second, first, FILLED, evidence, weights))


@pytest.mark.parametrize('shape', [(6, 7), (1, 8), (8, 1), (1, 1)])
def test_sweeps_sum_along_rows_and_then_along_columns(shape):
    rng = np.random.default_rng(5)
    weights = edge_weights(rng.integers(0, 12, shape, dtype=np.uint8))
    values = rng.normal(0, 1, shape).astype(np.float32)
    step = FADE * np.exp(weights / (-255 * 0.02))
    rows, sums = np.zeros(shape), np.zeros(shape)
    for y, x in np.ndindex(shape):
        rows[y, x] = sum(values[y, u] * step[y, min(x, u):max(x, u), 0].prod()
                         for u in range(shape[1]))
    for y, x in np.ndindex(shape):
        sums[y, x] = sum(rows[v, x] * step[min(y, v):max(y, v), x, 1].prod()
                         for v in range(shape[0]))
    np.testing.assert_allclose(sweep(values, weights, 0.02), sums, rtol=1e-4, atol=1e-5)

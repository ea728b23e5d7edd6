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

"""Choosing between candidates, and what neighbours have to say in it."""

import numpy as np
import pytest

from stereo_refine_ros.refinement.choice import choose, settle, take
from stereo_refine_ros.refinement.tuning import (
    ALIKE, MARGIN_GIVEN, MARGIN_HOLE, MARGIN_SLOPE, MARGINS)

SHAPE = (12, 16)
TEXTURE = np.random.default_rng(8).integers(0, 256, SHAPE, dtype=np.uint8)
FLAT = np.zeros((*SHAPE, 2), np.uint8)
GIVEN = np.full(SHAPE, 5, np.float32)
LEAST, LARGEST = MARGINS


def candidates(gain, other=8.0, count=2):
    """Return maps at 5 px, then at `other` and beyond, the last likelier by `gain`."""
    maps = np.stack([GIVEN] + [GIVEN - 5 + other + 4 * k for k in range(count - 1)])
    odds = np.full(maps.shape, -30, np.float32)
    odds[0] = -1
    odds[-1] = -1 + np.float32(gain)
    return maps, odds


def rough_map(seed=0):
    return np.random.default_rng(seed).uniform(0, 50, SHAPE).astype(np.float32)


@pytest.mark.parametrize('gain, moves', [(LEAST - 0.1, False), (LARGEST + 0.2, True)])
def test_what_was_given_stays_below_the_margin(gain, moves):
    maps, odds = candidates(gain)
    assert np.all(choose(maps, odds, GIVEN, FLAT) == moves)


def test_the_smoother_the_map_the_larger_the_margin():
    maps, odds = candidates((LEAST + LARGEST) / 2)
    assert np.all(choose(maps, odds, GIVEN, FLAT) == 0)
    assert np.all(choose(maps, odds, rough_map(), FLAT) == 1)


def test_a_hole_gives_way_where_a_given_pixel_of_a_smooth_map_does_not():
    given = GIVEN.copy()
    given[3:9, 4:12] = np.nan
    assert 0 <= MARGIN_HOLE < LARGEST
    which = choose(*candidates((MARGIN_HOLE + LARGEST) / 2), given, FLAT)
    np.testing.assert_array_equal(which == 1, np.isnan(given))
    assert np.all(choose(*candidates(MARGIN_HOLE - 0.1), given, FLAT) == 0)


def test_of_several_the_likeliest_is_chosen():
    maps, odds = candidates(LARGEST + 3, count=4)
    odds[1] = odds[0] + LARGEST + 2
    assert np.all(choose(maps, odds, GIVEN, FLAT) == 3)
    odds[1] = odds[0] + LARGEST + 4
    assert np.all(choose(maps, odds, GIVEN, FLAT) == 1)


def test_a_candidate_that_says_nearly_the_same_is_not_worth_a_move():
    assert np.all(choose(*candidates(100, other=5 + ALIKE - 0.01), GIVEN, FLAT) == 0)
    assert np.all(choose(*candidates(100, other=5 + ALIKE + 0.01), GIVEN, FLAT) == 1)


def edges_around(y, x):
    """Return edge weights of a flat image with one pixel of another colour."""
    weights = FLAT.copy()
    weights[y, x - 1:x + 1, 0] = weights[y - 1:y + 1, x, 1] = 255
    return weights


def test_a_pixel_among_its_like_does_not_decide_alone():
    maps, odds = candidates(-3)
    odds[1, 6, 8] = odds[0, 6, 8] + LARGEST + 1
    assert np.all(choose(maps, odds, GIVEN, FLAT) == 0)
    which = choose(maps, odds, GIVEN, edges_around(6, 8))
    assert which[6, 8] == 1 and np.count_nonzero(which) == 1


def test_neighbours_count_only_where_they_have_something_to_choose():
    maps, odds = candidates(LARGEST + 0.5)
    maps[1, :, :8] = maps[0, :, :8]
    odds[1, :, :8] = odds[0, :, :8] - 50
    which = choose(maps, odds, GIVEN, FLAT)
    assert np.all(which[:, 8:] == 1) and np.all(which[:, :8] == 0)


@pytest.mark.parametrize('step, gain, moves', [
    (0.1, 2.45, False), (0.1, 2.55, True), (0.15, 1.65, False), (0.15, 1.8, True)])
def test_the_margin_of_a_given_map_follows_its_mean_bend(step, gain, moves):
    given = GIVEN + step * np.float32(np.arange(SHAPE[1]) % 2)  # bends by 2 x step along rows
    bend = step  # the mean of that and of 0 along columns
    margin = MARGIN_GIVEN - MARGIN_SLOPE * (np.log(bend + 0.005) + 2)
    assert (gain > margin) == moves
    maps, odds = candidates(gain)
    maps[0] = given
    assert np.all(choose(maps, odds, given, FLAT) == moves)


def test_a_map_of_which_no_bend_is_known_has_the_middle_margin():
    for gain, moves in ((MARGIN_GIVEN - 0.1, 0), (MARGIN_GIVEN + 0.1, 1)):
        maps, odds = (part[:, :2, :2] for part in candidates(gain))
        assert np.all(choose(maps, odds, GIVEN[:2, :2], FLAT[:2, :2]) == moves)


def test_a_map_too_small_to_be_rough_is_chosen_from_too():
    maps, odds = (part[:, :1, :2] for part in candidates(LARGEST + 0.5))
    given = np.float32([[5, np.nan]])
    assert choose(maps, odds, given, FLAT[:1, :2]).tolist() == [[1, 1]]
    assert choose(maps, odds, given * np.nan, FLAT[:1, :2]).tolist() == [[1, 1]]


def test_choice_is_one_of_the_candidates_and_inputs_stay():
    rng = np.random.default_rng(7)
    maps = rng.uniform(0, 20, (5, *SHAPE)).astype(np.float32)
    odds = rng.normal(0, 2, (5, *SHAPE)).astype(np.float32)
    weights = rng.integers(0, 40, (*SHAPE, 2)).astype(np.uint8)
    copies = maps.copy(), odds.copy()
    which = choose(maps, odds, maps[0], weights)
    assert 0 <= which.min() < which.max() <= 4
    np.testing.assert_array_equal(maps, copies[0])
    np.testing.assert_array_equal(odds, copies[1])


def test_where_nothing_is_to_be_seen_nothing_is_likely():
    odds = np.full(SHAPE, 3, np.float32)
    plain = np.full((*SHAPE, 3), 250, np.uint8)
    assert (settle(odds, FLAT, plain) < -1).all()


@pytest.mark.parametrize('level, is_plain', [(1, True), (3, False)])
def test_plain_is_what_differs_by_less_than_a_grey_level(level, is_plain):
    stripes = np.full(SHAPE, 90, np.uint8)
    stripes[:, ::2] += np.uint8(level)  # a deviation of about half a level, and of 1.4
    settled = settle(np.full(SHAPE, 3, np.float32), FLAT, stripes)
    assert np.all((settled < 0) == is_plain)


def test_equal_odds_settle_where_they_are():
    settled = settle(np.full(SHAPE, -1.5, np.float32), FLAT, TEXTURE)
    np.testing.assert_allclose(settled, -1.5, rtol=1e-5)


def test_odds_settle_half_way_to_their_neighbours():
    odds = np.full(SHAPE, 2, np.float32)
    odds[6, 8] = -4
    settled = settle(odds, FLAT, TEXTURE)
    # All neighbours together say nearly 2; the pixel itself counts half.
    assert -1.3 < settled[6, 8] < -0.7
    others = np.delete(settled.ravel(), 6 * SHAPE[1] + 8)
    assert 1.4 < others.min() < others.max() < 2.0
    # An edge keeps the doubt to itself.
    settled = settle(odds, edges_around(6, 8), TEXTURE)
    assert settled[6, 8] == pytest.approx(-4, abs=0.5)
    assert np.delete(settled.ravel(), 6 * SHAPE[1] + 8).min() > 1.9


@pytest.mark.parametrize('threads', [1, 2])
def test_what_was_chosen_is_taken(threads):
    maps = np.random.default_rng(0).random((4, 5, 6)).astype(np.float32)
    which = np.random.default_rng(1).integers(0, 4, (5, 6), np.uint8)
    taken = take(maps, which, threads)
    for y, x in np.ndindex(which.shape):
        assert taken[y, x] == maps[which[y, x], y, x]

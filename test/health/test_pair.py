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

"""The examiner of pairs: rows put right, health told, whatever came before and beside it."""

from concurrent.futures import ThreadPoolExecutor
import dataclasses
import math

import cv2
import numpy as np
import pytest
from real_pairs import lowered

from stereo_refine_ros.health.pair import PairExaminer
from stereo_refine_ros.health.suspicion import LOOKS
from stereo_refine_ros.health.views import measure_views
from stereo_refine_ros.params import load_preset
from stereo_refine_ros.rectification import RowOffset
from stereo_refine_ros.types import PairHealth, StereoPair

SHAPE = (192, 320)
SHIFT = 9
PARAMS = load_preset('accurate', {'matching.num_disparities': 32})


def examiner(**values):
    dotted = {name.replace('__', '.'): value for name, value in values.items()}
    return PairExaminer(load_preset('accurate', {'matching.num_disparities': 32, **dotted}))


def textured(seed=0):
    rng = np.random.default_rng(seed)
    wide = cv2.GaussianBlur(
        rng.integers(0, 256, (SHAPE[0], SHAPE[1] + SHIFT, 3)).astype(np.float32), (0, 0), 2)
    wide = np.clip(128 + 4 * (wide - wide.mean()), 0, 255).astype(np.uint8)
    return np.ascontiguousarray(wide[:, :SHAPE[1]]), np.ascontiguousarray(wide[:, SHIFT:])


@pytest.fixture(scope='module')
def pair():
    return StereoPair(*textured())


@pytest.fixture(scope='module')
def low_pair(pair):
    return StereoPair(pair.left, lowered(pair.right, 1.5))


def error(view, expected):
    inside = slice(8, -8)
    return np.abs(view[inside, inside].astype(float) - expected[inside, inside]).mean()


def same_bits(a, b):
    """Compare what `dataclasses.astuple` gives, NaN being equal to itself."""
    np.testing.assert_array_equal(dataclasses.astuple(a), dataclasses.astuple(b))


def rectify(examiner, pair, threads):
    prepared = examiner.prepare(pair, threads)
    return prepared.pair, prepared.offset


def examine(examiner, pair, offset, fine, given):
    views = PairHealth() if pair.right is None else measure_views(
        *(cv2.cvtColor(view, cv2.COLOR_BGR2GRAY) if view.ndim == 3 else view
          for view in (pair.left, pair.right)))
    seen = dataclasses.replace(examiner.prepare(pair, 1), pair=pair, offset=offset, views=views)
    return examiner.examine(seen, fine, given)


def test_the_row_offset_is_undone(pair, low_pair):
    found, offset = rectify(examiner(), low_pair, 1)
    assert offset.largest_px == pytest.approx(1.5, abs=0.1)
    assert found.left is low_pair.left
    assert error(low_pair.right, pair.right) > 3 * error(found.right, pair.right)
    for threads in (2, 3):
        again, _ = rectify(examiner(), low_pair, threads)
        np.testing.assert_array_equal(again.right, found.right)


def test_grey_views_are_put_right_as_well(low_pair):
    grey = StereoPair(*(cv2.cvtColor(view, cv2.COLOR_BGR2GRAY)
                        for view in (low_pair.left, low_pair.right)))
    found, offset = rectify(examiner(), grey, 1)
    assert offset.largest_px == pytest.approx(1.5, abs=0.1)
    assert found.right.shape == SHAPE and found.right.dtype == np.uint8


def test_where_nothing_is_to_be_corrected_the_bits_stay_and_the_offset_is_told(low_pair):
    found, offset = rectify(examiner(rectification__correct=False), low_pair, 1)
    assert found is low_pair
    assert offset.largest_px == pytest.approx(1.5, abs=0.1)


def test_views_that_agree_keep_their_bits(pair):
    found, offset = rectify(examiner(), pair, 1)
    assert offset.largest_px == 0
    np.testing.assert_array_equal(found.right, pair.right)


def test_without_the_past_the_same_bits_whatever_came_before(pair, low_pair):
    expected, offset = rectify(examiner(), low_pair, 1)
    seen = examiner()
    for other in (pair, StereoPair(low_pair.right, low_pair.left), pair):
        rectify(seen, other, 1)
    found, again = rectify(seen, low_pair, 1)
    np.testing.assert_array_equal(found.right, expected.right)
    same_bits(again, offset)


def test_with_the_past_a_pair_that_shows_nothing_takes_the_offset_of_the_others(low_pair):
    plain = np.full((*SHAPE, 3), 90, np.uint8)
    blank = StereoPair(plain, plain)
    settled = examiner(temporal__enabled=True)
    for _ in range(5):
        rectify(settled, low_pair, 1)
    assert rectify(settled, blank, 1)[1].largest_px == pytest.approx(1.5, abs=0.15)
    assert rectify(examiner(), blank, 1)[1].largest_px == 0


@pytest.mark.parametrize('height, width', [(1, 1), (1, 9), (9, 1), (5, 5), (20, 40)])
def test_pairs_too_small_to_say_anything_are_left_alone(height, width):
    across = np.linspace(40, 200, width).astype(np.uint8)
    pair = StereoPair(*np.stack([np.tile(across, (height, 1))] * 2))
    tiny = examiner()
    found, offset = rectify(tiny, pair, 2)
    np.testing.assert_array_equal(found.right, pair.right)
    assert offset.largest_px == 0
    health = examine(tiny, pair, offset, np.full((height, width), np.nan, np.float32), None)
    assert math.isnan(health.row_offset_px) and math.isnan(health.last_disparity_ratio)


def test_the_left_view_alone_has_neither_offset_nor_health(pair):
    alone = StereoPair(pair.left, None)
    one = examiner()
    found, offset = rectify(one, alone, 1)
    assert found is alone and offset.largest_px == 0
    same_bits(examine(one, alone, offset, np.ones(SHAPE, np.float32), None), PairHealth())


def test_health_of_a_good_pair(pair):
    matched = np.full(SHAPE, SHIFT, np.float32)
    health = examine(examiner(), pair, RowOffset(points=50), matched, None)
    assert health.row_offset_px == 0 and health.last_disparity_ratio == 0
    assert health.nearer_ratio == 0
    unknown = examine(examiner(), pair, RowOffset(), matched, None)
    assert math.isnan(unknown.row_offset_px)
    assert health.matched_ratio > 0.5 > max(health.swapped_ratio, health.upside_down_ratio)
    assert health.gain_ratio == pytest.approx(1, abs=0.02)
    assert not health.is_same_image and not health.fits_right_better
    assert math.isnan(health.given_agreement)
    exchanged = examine(
        examiner(), StereoPair(pair.right, pair.left), RowOffset(), matched, None)
    assert exchanged.swapped_ratio > 0.5 > exchanged.matched_ratio


def test_matches_at_the_end_of_the_range_are_counted(pair):
    fine = np.full(SHAPE, np.nan, np.float32)
    fine[:10], fine[10:20], fine[20:40] = 31, 30, 29.5
    assert examine(examiner(), pair, RowOffset(), fine, None).last_disparity_ratio == 0.5
    shifted = examiner(matching__min_disparity=-4)
    assert examine(shifted, pair, RowOffset(), fine - 4, None).last_disparity_ratio == 0.5


def test_a_map_from_outside_is_compared_with_the_own_match(pair):
    fine = np.full(SHAPE, SHIFT, np.float32)
    given = fine + np.float32(0.5)
    given[:48] += 20
    health = examine(examiner(), pair, RowOffset(), fine, given)
    assert health.given_agreement == pytest.approx(0.75, abs=0.02)
    assert not health.fits_right_better


def test_a_pair_is_measured_beside_its_matching_for_the_next_ones(pair, low_pair):
    watching, fine = examiner(temporal__enabled=True), np.ones(SHAPE, np.float32)
    first = watching.prepare(low_pair, 2)
    assert first.offset.offset_px == pytest.approx(1.5, abs=0.15)
    watching.examine(first, fine, None)
    seen, pair = [], StereoPair(pair.left, cv2.convertScaleAbs(pair.right, alpha=0.9))
    own = measure_views(pair.left_grey, pair.right_grey)
    for _ in range(4):  # as many as make a knock, and one more that it is undone in
        prepared = watching.prepare(pair, 2)
        seen.append(prepared.offset.offset_px)
        health = watching.examine(prepared, fine, None)
        assert health.row_offset_px == prepared.offset.largest_px
        assert health.gain_ratio == own.gain_ratio  # what the views show is this pair's
    assert seen[0] == first.offset.offset_px and abs(seen[3]) < 0.1


@pytest.mark.parametrize('is_temporal', [False, True])
def test_pairs_from_several_threads_do_not_meet(low_pair, is_temporal):
    shared = examiner(temporal__enabled=is_temporal)
    alone = examiner()
    expected, offset = rectify(alone, low_pair, 1)
    health = examine(alone, low_pair, offset, np.ones(SHAPE, np.float32), None)

    def one_frame(_):
        prepared = shared.prepare(low_pair, 1)
        return prepared.pair, shared.examine(prepared, np.ones(SHAPE, np.float32), None)
    with ThreadPoolExecutor(4) as pool:
        frames = list(pool.map(one_frame, range(12)))
    for found, told in frames:
        assert told.row_offset_px == pytest.approx(1.5, abs=0.15)
        assert told.gain_ratio == health.gain_ratio
        if not is_temporal:
            np.testing.assert_array_equal(found.right, expected.right)
            assert told.row_offset_px == health.row_offset_px
    # The look is another thread's, or not yet there.
    assert {told.matched_ratio for _, told in frames if not math.isnan(told.matched_ratio)} == {
        health.matched_ratio}


def test_other_parameters_keep_what_is_known_of_the_cameras(low_pair, asked):
    before = examiner(temporal__enabled=True)
    for _ in range(3):
        prepared = before.prepare(low_pair, 1)
    fine = np.full(SHAPE, SHIFT, np.float32)
    known = before.examine(prepared, fine, None)
    after = examiner(temporal__enabled=True, planes__seed=5)
    after.follow(before)
    again = after.prepare(low_pair, 1)
    same_bits(again.offset, prepared.offset)
    assert again.offset.largest_px == pytest.approx(1.5, abs=0.15)
    assert after.examine(again, fine, None).matched_ratio == known.matched_ratio
    assert asked.questions == list(LOOKS)  # the second examiner had no need of its own


def test_another_range_asks_for_the_rows_again(pair, low_pair):
    before = examiner(temporal__enabled=True)
    before.prepare(low_pair, 1)
    after = examiner(temporal__enabled=True, matching__num_disparities=48)
    after.follow(before)
    assert after.prepare(pair, 1).offset.largest_px < 0.1

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

"""Views of unlike exposure are made alike before matching."""

import cv2
import numpy as np
import pytest

from stereo_refine_ros.health.exposure import even_exposure
from stereo_refine_ros.health.pair import PairExaminer
from stereo_refine_ros.health.tuning import EXPOSURES
from stereo_refine_ros.params import load_preset
from stereo_refine_ros.types import StereoPair

SHAPE = (90, 120, 3)


def scene(shape=SHAPE):
    rng = np.random.default_rng(3)
    texture = cv2.GaussianBlur(rng.uniform(0, 255, shape).astype(np.float32), (0, 0), 3)
    return np.clip((texture - texture.mean()) * 5 + 120, 0, 255).astype(np.uint8).reshape(shape)


def with_levels(view, gain, offset=0):
    return np.clip(np.rint(view * np.asarray(gain) + offset), 0, 255).astype(np.uint8)


@pytest.mark.parametrize('gain, offset', [(0.8, -8), (0.6, 20), ((1.3, 1.0, 0.8), 0)])
def test_a_gain_is_undone_in_every_channel(gain, offset):
    left = scene()
    found = even_exposure(StereoPair(left, with_levels(left, gain, offset)))
    np.testing.assert_array_equal(found.left, left)
    assert np.abs(found.right.astype(int) - left).mean() < 1.5


def test_grey_views_stay_of_their_shape():
    left = scene(SHAPE[:2])
    found = even_exposure(StereoPair(left, with_levels(left, 0.7)))
    assert found.right.shape == left.shape and found.right.dtype == np.uint8
    assert np.abs(found.right.astype(int) - left).mean() < 1.5


@pytest.mark.parametrize('gain', [1, 0.95, 1.05, EXPOSURES[1] ** -1 * 0.9])
def test_views_that_are_alike_or_of_no_one_scene_stay_the_same_object(gain):
    left = scene()
    pair = StereoPair(left, with_levels(left, gain))
    assert even_exposure(pair) is pair


@pytest.mark.parametrize('level', [0, 90])
def test_a_plain_view_stays(level):
    pair = StereoPair(scene(), np.full(SHAPE, level, np.uint8))
    assert even_exposure(pair) is pair


def test_the_examiner_makes_exposures_alike_and_still_tells_of_them():
    left = scene()
    examiner = PairExaminer(load_preset('accurate', {'matching.num_disparities': 16}))
    prepared = examiner.prepare(StereoPair(left, with_levels(left, 0.7)), 1)
    assert np.abs(prepared.pair.right.astype(int) - left).mean() < 1.5
    assert prepared.views.gain_ratio == pytest.approx(0.7, abs=0.02)

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

"""What is asked of a pair only once in a while."""

import math

import numpy as np
import pytest

from stereo_refine_ros.health.long_look import LongLook
from stereo_refine_ros.health.suspicion import CoarseLook, LOOKS
from stereo_refine_ros.health.tuning import LOOK_EVERY_S
from stereo_refine_ros.params import load_preset
from stereo_refine_ros.types import StereoPair

MATCHING = load_preset('live').matching


@pytest.fixture
def pair():
    views = np.random.default_rng(0).integers(0, 256, (2, 24, 40), np.uint8)
    return StereoPair(*views)


def test_a_long_look_is_taken_bit_by_bit_once_in_a_while(pair, asked):
    watching = LongLook()
    assert math.isnan(watching.latest.as_is)

    def ask():
        asked.questions.clear()
        watching.ask(pair, MATCHING)
        return watching.latest, asked.questions
    first = CoarseLook(1, 2, 3, 4)
    assert ask() == (first, list(LOOKS))
    asked.now += 0.9 * LOOK_EVERY_S
    assert ask() == (first, [])
    asked.now += 0.2 * LOOK_EVERY_S
    for question in LOOKS[:-1]:
        assert ask() == (first, [question])
    assert ask() == (CoarseLook(1, 1, 1, 1), [LOOKS[-1]])
    assert ask() == (CoarseLook(1, 1, 1, 1), [])


def test_all_of_a_look_is_asked_of_one_pair(pair, asked):
    watching = LongLook()
    watching.ask(pair, MATCHING)
    asked.now += 1.1 * LOOK_EVERY_S
    asked.views.clear()
    black = StereoPair(pair.left, np.zeros_like(pair.right))
    for seen in (black, pair, pair, black):
        watching.ask(seen, MATCHING)
    assert len(asked.views) == len(LOOKS)
    for left, right in asked.views:
        np.testing.assert_array_equal(left, pair.left_grey)
        assert not right.any()


def test_a_map_is_looked_at_once_in_a_while(pair, asked):
    watching, given = LongLook(), np.ones(pair.shape, np.float32)
    for passed, number in ((0, 1), (0.9, 1), (0.2, 2)):
        asked.now += passed * LOOK_EVERY_S
        assert watching.fits_right(given, pair)
        assert asked.questions == ['fits right'] * number
    assert not LongLook().fits_right(given[1:], pair)

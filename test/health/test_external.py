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

"""An external map beside the own match, and beside the two views."""

import math

import cv2
import numpy as np
import pytest
from real_pairs import noisy
from real_scenes import real_scene_folder

from stereo_refine_ros.datasets.middlebury import read_scene
from stereo_refine_ros.health import fits_right_better, given_agreement

NAN = math.nan


def test_agreement_is_over_what_both_know():
    match = np.array([[10, 20, 30, NAN, 50]], np.float32)
    given = np.array([[11, 17, NAN, 40, 50]], np.float32)
    assert given_agreement(given, match) == pytest.approx(2 / 3)


def test_agreement_of_nothing_is_unknown():
    assert math.isnan(given_agreement(np.full((2, 2), NAN, np.float32),
                                      np.ones((2, 2), np.float32)))


def scene(name):
    found = read_scene(real_scene_folder(name))
    left, right = (cv2.cvtColor(view, cv2.COLOR_BGR2GRAY)
                   for view in (found.pair.left, found.pair.right))
    return found, left, right


@pytest.mark.parametrize('name', ['Art', 'Dolls', 'cones', 'teddy'])
def test_map_of_the_other_view_is_told(name):
    found, left, right = scene(name)
    assert not fits_right_better(found.truth, left, right)
    assert fits_right_better(found.truth_right, left, right)


@pytest.mark.parametrize('name', ['Art', 'cones', 'teddy'])
def test_map_of_the_other_view_is_told_on_bad_images_of_a_bad_map(name):
    found, left, right = scene(name)
    left, right = noisy(left, 5, 1), noisy(0.8 * right, 5, 2)
    maps = [np.where(np.random.default_rng(3).random(left.shape) < 0.3, NAN, truth + 0.5)
            for truth in (found.truth, found.truth_right)]
    assert not fits_right_better(maps[0], left, right)
    assert fits_right_better(maps[1], left, right)


@pytest.mark.parametrize('name', ['Art', 'cones'])
def test_wrong_maps_are_not_taken_for_the_other_view(name):
    found, left, right = scene(name)
    noise = np.random.default_rng(0).uniform(0, 60, left.shape).astype(np.float32)
    for given in (noise, np.full_like(noise, 30), found.truth + 8, np.full_like(noise, NAN)):
        assert not fits_right_better(given, left, right)
    assert not fits_right_better(found.truth, np.zeros_like(left), right)
    assert not fits_right_better(found.truth, left, np.zeros_like(right))


def test_one_column():
    column = np.ones((5, 1), np.uint8)
    assert not fits_right_better(np.ones((5, 1), np.float32), column, column)

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

"""Noise that is heavy beside what there is to see is cleared away before matching."""

import cv2
import numpy as np
import pytest

from stereo_refine_ros.health.clearing import clear_pair
from stereo_refine_ros.health.tuning import CLEAR_NOISE
from stereo_refine_ros.health.views import measure_views
from stereo_refine_ros.types import PairHealth, StereoPair


def noisy_pair(sigma, factor=1.0):
    rng = np.random.default_rng(0)
    texture = cv2.GaussianBlur(rng.uniform(0, 255, (120, 160)).astype(np.float32), (0, 0), 4)
    texture = (texture - texture.mean()) * 4 + 128
    views = [np.clip(texture * factor + rng.normal(0, sigma, texture.shape), 0, 255)
             for _ in range(2)]
    return StereoPair(*(np.rint(view).astype(np.uint8) for view in views)), texture


def cleared(pair):
    return clear_pair(pair, measure_views(pair.left, pair.right))


def test_a_clean_pair_stays_the_same_object():
    pair, _ = noisy_pair(0.5)
    assert cleared(pair) is pair


def test_unknown_noise_clears_nothing():
    pair, _ = noisy_pair(10)
    assert clear_pair(pair, PairHealth(contrast_left=40, contrast_right=40)) is pair


def test_noise_falls_by_half():
    pair, texture = noisy_pair(10)
    found = cleared(pair)
    gain = found.left.mean() / pair.left.mean()
    before = (pair.left - texture).std()
    assert (found.left / gain - texture).std() < 0.5 * before
    assert found.left.dtype == found.right.dtype == np.uint8


def test_a_dark_pair_is_brightened_by_one_factor():
    pair, _ = noisy_pair(1.2, 0.12)
    found = cleared(pair)
    ratio = found.left.mean() / pair.left.mean()
    assert ratio > 2
    assert np.count_nonzero(found.left == 255) < 0.02 * found.left.size
    assert found.right.mean() / pair.right.mean() == pytest.approx(ratio, rel=0.02)


def test_colour_becomes_grey_where_it_is_cleared():
    pair, _ = noisy_pair(10)
    colour = StereoPair(*(cv2.cvtColor(view, cv2.COLOR_GRAY2BGR)
                          for view in (pair.left, pair.right)))
    views = PairHealth(noise_sigma=CLEAR_NOISE * 40, contrast_left=40, contrast_right=50)
    np.testing.assert_array_equal(clear_pair(colour, views).left, clear_pair(pair, views).left)

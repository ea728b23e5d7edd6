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

"""Levels, noise, sharpness and contrast of made-up views, against what was put into them."""

import math

import cv2
import numpy as np
import pytest
from real_pairs import noisy

from stereo_refine_ros.health import measure_views, noise_sigma

pytestmark = pytest.mark.compiled

SHAPE = 240, 320


def texture(seed=0, sigma=2.0, mean=128, deviation=40):
    noise = np.random.default_rng(seed).normal(size=SHAPE)
    smooth = cv2.GaussianBlur(noise, (0, 0), sigma)
    return np.rint(mean + deviation * smooth / smooth.std()).clip(0, 255).astype(np.uint8)


@pytest.mark.parametrize('sigma', [1.0, 2.0, 5.0, 10.0, 20.0])
def test_noise_of_a_plain_wall(sigma):
    assert noise_sigma(noisy(np.full(SHAPE, 128.0), sigma, 0)) == pytest.approx(sigma, rel=0.1)


@pytest.mark.parametrize('sigma', [2.0, 5.0, 10.0])
def test_noise_of_a_picture(sigma):
    found = noise_sigma(noisy(texture(sigma=6.0).astype(float), sigma, 1))
    assert found == pytest.approx(sigma, rel=0.15)


def test_no_noise_where_there_is_none():
    assert noise_sigma(np.full(SHAPE, 128, np.uint8)) == 0.0
    assert noise_sigma(np.tile(np.arange(0, 160, 0.5).astype(np.uint8), (240, 1))) <= 0.3


@pytest.mark.parametrize('image', [
    np.zeros(SHAPE, np.uint8), np.full(SHAPE, 255, np.uint8), np.full((4, 4), 128, np.uint8)],
    ids=['black', 'white', 'small'])
def test_noise_is_unknown_where_nothing_is_seen_of_it(image):
    assert math.isnan(noise_sigma(image))


@pytest.mark.parametrize('gain', [0.5, 0.8, 1.3])
def test_gain_of_the_right_view(gain):
    left = texture(deviation=20, mean=100)
    right = np.rint(gain * left).astype(np.uint8)
    health = measure_views(left, right)
    assert health.gain_ratio == pytest.approx(gain, abs=0.01)
    assert health.contrast_right == pytest.approx(gain * health.contrast_left, rel=0.03)
    assert health.sharpness_ratio >= 0.9


def test_blurred_view_either_side():
    sharp = noisy(texture().astype(float), 2.0, 1)
    blurred = noisy(cv2.GaussianBlur(texture().astype(float), (0, 0), 2.0), 2.0, 2)
    first = measure_views(sharp, blurred).sharpness_ratio
    assert first <= 0.65
    assert measure_views(blurred, sharp).sharpness_ratio == first


def test_saturated_pixels():
    view = texture(deviation=10)
    view[:60] = 255
    view[60:90] = 0
    assert measure_views(view, view).saturated_ratio == pytest.approx(90 / 240, abs=0.02)


def test_one_image_twice():
    view, other = texture(), texture()
    assert measure_views(view, view.copy()).is_same_image
    other[17, 23] += 1
    assert not measure_views(view, other).is_same_image


@pytest.mark.parametrize('level', [0, 255])
def test_two_dead_cameras(level):
    """They are no evidence of one image twice, and have no gain, noise or sharpness."""
    dead = np.full(SHAPE, level, np.uint8)
    health = measure_views(dead, dead)
    assert not health.is_same_image
    assert (health.contrast_left, health.contrast_right, health.saturated_ratio) == (0, 0, 1)
    assert math.isnan(health.noise_sigma)
    assert math.isnan(health.sharpness_ratio)
    assert health.gain_ratio == 1.0 if level else math.isnan(health.gain_ratio)


@pytest.mark.parametrize('shape', [(1, 1), (1, 50), (50, 1), (3, 3)])
def test_tiny_views(shape):
    health = measure_views(np.full(shape, 9, np.uint8), np.full(shape, 18, np.uint8))
    assert health.gain_ratio == 2.0
    assert health.contrast_left == 0.0


def test_the_rest_is_left_unknown():
    health = measure_views(texture(), texture(1))
    assert math.isnan(health.matched_ratio)
    assert math.isnan(health.row_offset_px)
    assert math.isnan(health.upside_down_ratio)

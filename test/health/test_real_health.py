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

"""Health of real pairs, and of the same pairs broken: a threshold between them exists."""

import cv2
import numpy as np
import pytest
from real_pairs import CAMERAS, darkened, FIELD, LAB, load, noisy

from stereo_refine_ros.health import measure_views, suspect
from stereo_refine_ros.health_advice import NEARER

pytestmark = pytest.mark.compiled

PAIRS = LAB + FIELD + CAMERAS
SOME = ('middlebury/cones', 'field/middlebury/Lampshade1', 'field/eth3d/delivery_area_3l',
        'field/eth3d/terrains_1l', 'field/kitti2012/000072_10', 'field/cameras/oak_stairs')
# What the limits of the diagnostics are measured against.
HEALTHY_GAIN, SHARP, BLURRED, CONTRAST, COVERED = (0.9, 1.2), 0.75, 0.5, 20.0, 10.0
MATCHED, MISMATCHED = 0.5, 0.42


@pytest.mark.parametrize('name', PAIRS)
def test_healthy_pair(name):
    pair = load(name)
    health = measure_views(pair.left, pair.right)
    assert HEALTHY_GAIN[0] <= health.gain_ratio <= HEALTHY_GAIN[1]
    assert 0.1 <= health.noise_sigma <= 2.5
    assert health.sharpness_ratio >= SHARP
    assert health.saturated_ratio <= 0.2
    assert min(health.contrast_left, health.contrast_right) >= CONTRAST
    assert not health.is_same_image


@pytest.mark.parametrize('name', PAIRS)
def test_gain_noise_and_dark_are_measured(name):
    pair = load(name)
    own = measure_views(pair.left, pair.right)
    dim = np.rint(0.7 * pair.right).astype(np.uint8)
    assert (measure_views(pair.left, dim).gain_ratio
            == pytest.approx(0.7 * own.gain_ratio, abs=0.01))
    for sigma in (5.0, 10.0):
        health = measure_views(noisy(pair.left, sigma, 1), noisy(pair.right, sigma, 2))
        expected = np.hypot(sigma, own.noise_sigma)
        assert health.noise_sigma == pytest.approx(expected, rel=0.1)
        assert health.sharpness_ratio >= 0.5
    dark = measure_views(darkened(pair.left, 1), darkened(pair.right, 2))
    assert dark.noise_sigma == pytest.approx(1.2, abs=0.2)


@pytest.mark.parametrize('name', PAIRS)
def test_blurred_right_view(name):
    pair = load(name)
    for sigma in (1.0, 2.0, 5.0):
        blurred = np.asarray(cv2.GaussianBlur(pair.right, (0, 0), sigma))
        assert measure_views(pair.left, blurred).sharpness_ratio <= BLURRED


@pytest.mark.parametrize('name', PAIRS)
def test_covered_black_and_fogged_lens(name):
    pair = load(name)
    blurred = cv2.GaussianBlur(pair.right, (0, 0), 25)
    covered = np.rint(0.1 * blurred).astype(np.uint8)
    health = measure_views(pair.left, covered)
    assert health.contrast_right <= COVERED
    assert health.gain_ratio <= 0.2
    health = measure_views(pair.left, np.zeros_like(covered))
    assert (health.contrast_right, health.gain_ratio) == (0.0, 0.0)
    fogged = np.rint(0.25 * cv2.GaussianBlur(pair.right, (0, 0), 4) + 150).astype(np.uint8)
    health = measure_views(pair.left, fogged)
    assert health.contrast_right <= 0.3 * health.contrast_left
    assert health.sharpness_ratio <= 0.6


@pytest.mark.parametrize('name', PAIRS)
def test_frozen_camera_shows_one_image_twice(name):
    pair = load(name)
    assert measure_views(pair.left, pair.left.copy()).is_same_image


@pytest.mark.parametrize('name', PAIRS)
def test_coarse_look_tells_how_a_pair_was_put_together(name):
    pair = load(name)
    right_turned = np.ascontiguousarray(pair.right[::-1, ::-1])
    good = suspect(pair.left, pair.right, 0, pair.disparities)
    swapped = suspect(pair.right, pair.left, 0, pair.disparities)
    turned = suspect(pair.left, right_turned, 0, pair.disparities)
    assert good.as_is >= MATCHED
    assert max(good.upside_down, good.swapped) <= MISMATCHED
    assert good.as_is >= 1.5 * max(good.upside_down, good.swapped)
    assert (swapped.as_is, swapped.swapped) == (good.swapped, good.as_is)
    # Half a turn of a size that is no multiple of the coarse one's falls between the pixels.
    assert turned.as_is == pytest.approx(good.upside_down, abs=0.05)
    assert turned.upside_down == pytest.approx(good.as_is, abs=0.05)


@pytest.mark.parametrize('name', PAIRS)
def test_nothing_is_nearer_than_a_range_that_is_long_enough(name):
    pair = load(name)
    assert suspect(pair.left, pair.right, 0, pair.disparities).nearer <= 0.6 * NEARER


@pytest.mark.parametrize('name', [
    'middlebury/cones', 'middlebury/venus', 'field/middlebury/Motorcycle',
    'field/middlebury/Playroom', 'field/kitti2012/000032_10', 'field/cameras/oak_pov_hands'])
def test_what_is_nearer_than_the_range_is_seen(name):
    pair = load(name)
    half = 64 if 'oak' in name else pair.disparities // 2
    assert suspect(pair.left, pair.right, 0, half).nearer >= 4 * NEARER


@pytest.mark.parametrize('name', SOME)
def test_coarse_look_at_a_dead_camera(name):
    pair = load(name)
    look = suspect(pair.left, np.zeros_like(pair.right), 0, pair.disparities)
    assert max(look.as_is, look.upside_down, look.swapped, look.nearer) <= 0.1


def test_coarse_look_at_tiny_views():
    view = np.full((2, 3), 7, np.uint8)
    look = suspect(view, view, 0, 64)
    assert 0.0 <= look.as_is <= 1.0

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

"""16-bit images to 8 bits: by their own range, both views alike, steady over time."""

import numpy as np
import pytest

from stereo_refine_ros.datasets import render_scene
from stereo_refine_ros.grey_range import SteadyRange
from stereo_refine_ros.params import load_preset
from stereo_refine_ros.pipeline import StereoRefiner


@pytest.fixture(scope='module')
def scene():
    return render_scene(3, 120, 160, 24, 3)


def _grey(view):
    return view.mean(axis=2)


def _wrong(scene, left, right):
    params = load_preset('live', {'matching.num_disparities': 24})
    values = StereoRefiner(params).process(left, right).disparity.values
    return 100 * np.mean(np.abs(values - scene.truth) > 1)


@pytest.mark.parametrize('bits, fill', [
    (8, 1.0), (10, 1.0), (12, 1.0), (14, 1.0), (16, 1.0), (10, 0.5), (12, 0.2), (16, 0.05)])
def test_any_number_of_bits_matches_as_8_bits_do(scene, bits, fill):
    """A 10-bit image divided by 257, as cv_bridge does, has five grey levels left."""
    views = [_grey(view) for view in (scene.pair.left, scene.pair.right)]
    in_8 = [np.rint(view).astype(np.uint8) for view in views]
    deep = [np.rint(view * fill * (2 ** bits - 1) / 255).astype(np.uint16) for view in views]
    assert _wrong(scene, *SteadyRange().to_8bit(*deep)) <= _wrong(scene, *in_8) + 1.0


def test_one_scale_for_both_views():
    left = np.linspace(100, 900, 4096).reshape(64, 64).astype(np.uint16)
    right = (left * 0.5).astype(np.uint16)
    a, b = SteadyRange().to_8bit(left, right)
    slope_a, slope_b = (np.polyfit(deep.ravel(), shallow.ravel(), 1)[0]
                        for deep, shallow in ((left, a), (right, b)))
    assert slope_a == pytest.approx(slope_b, rel=0.01)
    # the range of both together, 50 to 900, and an eighth of it at either end
    assert slope_a == pytest.approx(255 / (900 + 106), rel=0.01)


def test_light_that_changes_a_little_does_not_change_the_scale():
    base = np.linspace(300, 3000, 4096).reshape(64, 64)
    steady = SteadyRange()
    first, = steady.to_8bit(base.astype(np.uint16))
    for gain in (0.9, 1.05, 0.8, 1.1):
        steady.to_8bit((base * gain).astype(np.uint16))
    again, = steady.to_8bit(base.astype(np.uint16))
    np.testing.assert_array_equal(first, again)


def test_light_that_changes_a_lot_does():
    base = np.linspace(300, 3000, 4096).reshape(64, 64)
    steady = SteadyRange()
    steady.to_8bit(base.astype(np.uint16))
    bright, = steady.to_8bit((base * 10).astype(np.uint16))
    assert bright.max() < 255 and bright.std() > 50
    dark, = steady.to_8bit((base * 0.2).astype(np.uint16))
    assert dark.std() > 50


def test_few_hot_pixels_do_not_darken_the_image():
    image = np.linspace(100, 900, 1 << 16).reshape(256, 256).astype(np.uint16)
    spotted = image.copy()
    spotted[::64, ::64] = 65535
    plain, hot = (SteadyRange().to_8bit(view)[0] for view in (image, spotted))
    assert np.abs(plain.astype(int) - hot)[spotted < 65535].max() <= 1
    assert (hot[spotted == 65535] == 255).all()


def test_a_covered_lens_stays_without_contrast():
    noise = np.random.default_rng(0).normal(64, 3, (64, 64)).astype(np.uint16)
    view, = SteadyRange().to_8bit(noise)
    assert view.std() == pytest.approx(noise.std(), rel=0.1)


@pytest.mark.parametrize('value', [0, 1, 255, 256, 40000, 65535])
def test_constant_images_of_any_level(value):
    view, = SteadyRange().to_8bit(np.full((5, 7), value, np.uint16))
    assert view.dtype == np.uint8 and view.shape == (5, 7)
    assert len(np.unique(view)) == 1


def test_8_bits_are_left_alone_and_colour_keeps_its_shape():
    shallow = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    deep = (np.arange(24).reshape(2, 4, 3) * 1000).astype(np.uint16)
    same, colour = SteadyRange().to_8bit(shallow, deep)
    assert same is shallow
    assert colour.shape == (2, 4, 3) and (np.diff(colour.ravel().astype(int)) > 0).all()

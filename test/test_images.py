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

"""Grey images, gradients, borders and halves, on numbers that can be checked by hand."""

import cv2
import numpy as np
import pytest

from stereo_refine_ros import images

GREY = np.array([[10, 20, 60], [30, 0, 255]], np.uint8)


def test_a_grey_image_is_its_own_grey_and_a_colour_image_is_weighed():
    assert images.to_grey(GREY) is GREY
    pixels = np.array([[[100, 0, 0], [0, 100, 0], [0, 0, 100]]], np.uint8)
    assert images.to_grey(pixels).tolist() == [[11, 59, 30]]


@pytest.mark.parametrize('dtype', [np.uint8, np.uint16])
def test_an_image_is_taken_apart_and_a_grey_one_is_its_one_channel(dtype):
    grey, = images.channels_of(GREY.astype(dtype))
    np.testing.assert_array_equal(grey, GREY)
    colour = np.stack([GREY, GREY // 2, GREY // 3], axis=2).astype(dtype)
    for k, channel in enumerate(images.channels_of(colour)):
        assert channel.dtype == dtype
        np.testing.assert_array_equal(channel, colour[..., k])


def test_three_channels_of_a_grey_image_are_equal_and_turn_grey_again():
    levels = np.arange(256, dtype=np.uint8)[None]
    colour = images.to_bgr(levels)
    assert colour.shape == (1, 256, 3)
    np.testing.assert_array_equal(colour, np.repeat(levels[..., None], 3, axis=2))
    np.testing.assert_array_equal(images.to_grey(colour), levels)
    assert images.to_bgr(colour) is colour


def test_gradients_are_differences_of_neighbours():
    assert images.gradient_x(GREY).tolist() == [[0, 50, 0], [0, 225, 0]]
    assert images.gradient_x(GREY, cv2.BORDER_REPLICATE).tolist() == [[10, 50, 40],
                                                                      [-30, 225, 255]]
    column = np.array([[10], [20], [5]], np.uint8)
    assert images.gradient_y(column).tolist() == [[0], [-5], [0]]
    assert images.gradient_x(column, cv2.BORDER_REPLICATE).tolist() == [[0], [0], [0]]
    assert images.gradient_x(GREY).dtype == images.gradient_y(GREY).dtype == np.int16


def test_padding_repeats_the_border():
    assert images.pad(GREY, (1, 0), (0, 2)).tolist() == [
        [10, 20, 60, 60, 60], [10, 20, 60, 60, 60], [30, 0, 255, 255, 255]]


@pytest.mark.parametrize('channels', [(), (3,)])
@pytest.mark.parametrize('shape', [(4, 6), (5, 6), (4, 7), (1, 5), (3, 1)])
def test_halving_averages_two_by_two_and_repeats_what_is_alone(shape, channels):
    image = np.random.default_rng(0).integers(0, 256, (*shape, *channels), dtype=np.uint8)
    height, width = (-(-side // 2) for side in shape)
    half = images.halve(image)
    assert half.shape == (height, width, *channels) and half.dtype == np.uint8
    for y in range(height):
        for x in range(width):
            rows = [2 * y, min(2 * y + 1, shape[0] - 1)]
            columns = [2 * x, min(2 * x + 1, shape[1] - 1)]
            mean = image[np.ix_(rows, columns)].reshape(4, -1).mean(axis=0)
            np.testing.assert_allclose(half[y, x], mean, atol=0.5)

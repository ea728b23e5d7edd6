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

"""Pairs out of messages of any kind, by one decoder of a camera."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from stereo_refine_ros.camera_info import CameraModel
from stereo_refine_ros.decoding import PairDecoder, view_size
from stereo_refine_ros.encodings import BadMessage

WIDTH, HEIGHT = 32, 24


def plain(pixels):
    encoding = {(2, 1): 'mono8', (2, 2): 'mono16', (3, 1): 'bgr8'}[pixels.ndim, pixels.itemsize]
    return SimpleNamespace(
        height=pixels.shape[0], width=pixels.shape[1], encoding=encoding, is_bigendian=0,
        step=pixels.nbytes // pixels.shape[0], data=pixels.tobytes())


def packed(pixels):
    return SimpleNamespace(format='png', data=cv2.imencode('.png', pixels)[1].tobytes())


@pytest.fixture(scope='module')
def colour():
    return np.random.default_rng(1).integers(0, 256, (HEIGHT, WIDTH, 3), np.uint8)


def test_plain_and_compressed_may_mix(colour):
    pair = PairDecoder().decode(plain(colour), packed(colour[::-1]))
    np.testing.assert_array_equal(pair.left, colour)
    np.testing.assert_array_equal(pair.right, colour[::-1])


def test_left_alone(colour):
    pair = PairDecoder().decode(packed(colour))
    np.testing.assert_array_equal(pair.left, colour)
    assert pair.right is None


def test_one_grey_view_makes_both_grey(colour):
    grey = cv2.cvtColor(colour, cv2.COLOR_BGR2GRAY)
    pair = PairDecoder().decode(plain(colour), plain(grey))
    np.testing.assert_array_equal(pair.left, grey)
    np.testing.assert_array_equal(pair.right, grey)


def test_sizes_are_read_without_pixels_and_must_agree(colour):
    assert view_size('left', plain(colour)) == view_size('left', packed(colour)) == (
        WIDTH, HEIGHT)
    with pytest.raises(BadMessage, match='32 x 24, right image 16 x 24') as error:
        PairDecoder().decode(plain(colour), packed(colour[:, :16]))
    assert error.value.reason == 'size_differs'


def test_the_scale_of_16_bits_stays_from_pair_to_pair(colour):
    deep = colour[..., 0].astype(np.uint16) * 14 + 100
    darker = (deep * 0.9).astype(np.uint16)
    decoder = PairDecoder()
    first = decoder.decode(plain(deep), plain(deep)).left.astype(float)
    second = decoder.decode(plain(darker), plain(darker)).left.astype(float)
    slope = np.polyfit(deep.ravel(), first.ravel(), 1)[0]
    assert np.polyfit(darker.ravel(), second.ravel(), 1)[0] == pytest.approx(slope, rel=0.01)
    # Nothing stays from another camera.
    other = PairDecoder().decode(plain(darker), plain(darker)).left.astype(float)
    assert np.polyfit(darker.ravel(), other.ravel(), 1)[0] > 1.05 * slope


def test_raw_images_are_turned_by_their_own_calibration(colour):
    cx, cy = (WIDTH - 1) / 2, (HEIGHT - 1) / 2
    k, p = [40.0, 0, cx, 0, 40.0, cy, 0, 0, 1], [40.0, 0, cx, 0, 0, 40.0, cy, 0, 0, 0, 1, 0]
    same, turned = (CameraModel(WIDTH, HEIGHT, 'plumb_bob', [0.0] * 5, k, list(r), p)
                    for r in (np.eye(3).ravel(), np.diag([-1.0, -1.0, 1.0]).ravel()))
    pair = PairDecoder().decode(plain(colour), plain(colour), (same, turned))
    np.testing.assert_array_equal(pair.left, colour)
    np.testing.assert_array_equal(pair.right, colour[::-1, ::-1])
    turned.r = [0.0] * 9
    with pytest.raises(BadMessage, match='^right/camera_info: R is no rotation'):
        PairDecoder().decode(plain(colour), plain(colour), (same, turned))


def test_messages_are_called_by_their_topics(colour):
    bad = packed(colour)
    bad.data = bad.data[:50]
    with pytest.raises(BadMessage, match='^/cam1/image_raw/compressed: the png is cut off'):
        PairDecoder(('/cam0/image_raw', '/cam1/image_raw/compressed')).decode(
            plain(colour), bad)

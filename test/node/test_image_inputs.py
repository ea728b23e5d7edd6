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

"""Compressed, raw and 16-bit images through a running node; what is wrong with them is counted."""

import struct

import cv2
from harness import (
    floats, image_message, stamp_of, stereo_messages, textured_pair)
from live_node import diagnosis, good_pair, settled_health, stamps
import numpy as np
import pytest
import rclpy
from real_scenes import real_scene_folder
from sensor_msgs.msg import CameraInfo, CompressedImage

from stereo_refine_ros.datasets import iterate_folder
from stereo_refine_ros.datasets.calibration import read_euroc
from stereo_refine_ros.datasets.folder import list_pairs
from stereo_refine_ros.health_advice import FRAMES_LOOKED_AT
from stereo_refine_ros.node.inputs import Inputs
from stereo_refine_ros.params import load_preset

pytestmark = pytest.mark.ros
IMAGES = ('left/image_rect', 'right/image_rect')
COMPRESSED = tuple(f'{topic}/compressed' for topic in IMAGES)


def compressed(data, kind, stamp):
    message = CompressedImage(format=kind)
    message.header.stamp = stamp_of(stamp)
    message.header.frame_id = 'left_optical'
    message.data.frombytes(bytes(data))
    return message


def compressed_pair(left, right, suffix='.png', kind='bgr8; png compressed bgr8'):
    """Return the messages of a pair, its images compressed and under their own names."""
    stamp = next(stamps)
    messages = stereo_messages(left, right, stamp, cx_right=77.5)
    for topic, view in zip(IMAGES, (left, right), strict=True):
        del messages[topic]
        messages[f'{topic}/compressed'] = compressed(
            cv2.imencode(suffix, view)[1].tobytes(), kind, stamp)
    return messages


@pytest.fixture(scope='module', autouse=True)
def steady(client):
    assert client.set(temporal__enabled=False)[0].successful


@pytest.fixture
def by_compressed(client):
    """Switch the running node over, and back afterwards."""
    assert client.set(inputs__image_transport='compressed')[0].successful
    for topic in COMPRESSED:
        client.publisher(topic, CompressedImage)
    client.connect(COMPRESSED)
    yield
    assert client.set(inputs__image_transport='raw')[0].successful
    client.connect(IMAGES)


@pytest.fixture(scope='module')
def plain(client):
    """Return what the node makes of the pair as plain images."""
    return floats(client.exchange(good_pair())[0].image)


def test_compressed_pair_gives_what_the_plain_one_gives(client, plain, by_compressed):
    disparity, = client.exchange(compressed_pair(*textured_pair()))
    np.testing.assert_array_equal(floats(disparity.image), plain)
    disparity, = client.exchange(compressed_pair(*textured_pair(), '.jpg', 'jpeg'))
    valid = floats(disparity.image) > 1
    assert np.abs(floats(disparity.image)[valid] - plain[valid]).mean() < 0.5


def test_plain_images_come_again_after_switching_back(client, plain):
    np.testing.assert_array_equal(floats(client.exchange(good_pair())[0].image), plain)


@pytest.mark.parametrize('remap, name', [
    ('left/image_rect:=/cam/left/image', '/cam/left/image/compressed'),
    ('left/image_rect/compressed:=/cam/jpeg', '/cam/jpeg'),
    ('right/image_rect:=/other', '/robot/left/image_rect/compressed')])
def test_compressed_topics_follow_the_image_as_image_transport_has_it(remap, name):
    context = rclpy.Context()
    context.init()
    node = rclpy.create_node('listener', namespace='robot', context=context,
                             cli_args=['--ros-args', '-r', remap])
    inputs = Inputs(node, load_preset('live', {'inputs.image_transport': 'compressed'}),
                    *[lambda *args: None] * 4)
    assert inputs.source('left/image_rect') == (name, CompressedImage)
    assert inputs.source('left/camera_info') == ('/robot/left/camera_info', CameraInfo)
    node.destroy_node()
    context.try_shutdown()


@pytest.mark.parametrize('spoil, reason', [
    (lambda data: data[:len(data) // 2], 'data_size'),
    (lambda data: data[:16] + struct.pack('>II', 60000, 60000) + data[24:], 'too_large'),
    (lambda data: b'no image at all', 'encoding'),
    (lambda data: cv2.imencode('.png', np.zeros((64, 64), np.uint8))[1].tobytes(),
     'size_differs')])
def test_damaged_and_enormous_files_are_refused_and_counted(
        client, plain, by_compressed, spoil, reason):
    messages = compressed_pair(*textured_pair())
    bad = messages['right/image_rect/compressed']
    data = spoil(bytes(bad.data))
    del bad.data[:]
    bad.data.frombytes(data)
    before = client.health().get(f'refused.{reason}', 0) if client.received[
        '/diagnostics'] else 0
    client.send(messages)
    settled_health(client, lambda health: health.get(f'refused.{reason}', 0) == before + 1)
    disparity, = client.exchange(compressed_pair(*textured_pair()))
    np.testing.assert_array_equal(floats(disparity.image), plain)


@pytest.mark.parametrize('bits', [10, 12, 16])
def test_deep_images_by_their_own_range(client, plain, bits):
    left, right = textured_pair(color=False)
    messages = stereo_messages(left, right, next(stamps), cx_right=77.5)
    reference = floats(client.exchange(messages)[0].image)
    messages = stereo_messages(left, right, next(stamps), cx_right=77.5)
    stamp = messages['left/image_rect'].header.stamp
    stamp = stamp.sec * 10 ** 9 + stamp.nanosec
    for topic, view in zip(IMAGES, (left, right), strict=True):
        deep = (view.astype(np.uint32) * (2 ** bits - 1) // 255).astype(np.uint16)
        messages[topic] = image_message(deep, 'mono16', stamp)
    values = floats(client.exchange(messages)[0].image)
    valid = (values > 1) & (reference > 1)
    assert valid.mean() > 0.8
    assert np.mean(np.abs(values - reference)[valid] > 1) < 0.02


def _info(model, stamp):
    info = CameraInfo(width=model.width, height=model.height, d=model.d, k=model.k, r=model.r,
                      p=model.p, distortion_model=model.distortion_model)
    info.header.stamp, info.header.frame_id = stamp_of(stamp), 'left_optical'
    return info


def _raw_pair(folder, index):
    files = list_pairs(folder)[index][1:]
    models = read_euroc(*(folder / 'mav0' / camera / 'sensor.yaml' for camera in ('cam0', 'cam1')))
    stamp, messages = next(stamps), {}
    for side, path, model in zip(('left', 'right'), files, models, strict=True):
        messages[f'{side}/image_rect'] = image_message(cv2.imread(str(path), 0), 'mono8', stamp)
        messages[f'{side}/camera_info'] = _info(model, stamp)
    return messages


@pytest.fixture
def rectifying(client):
    assert client.set(inputs__rectify=True)[0].successful
    yield
    assert client.set(inputs__rectify=False)[0].successful


def test_raw_pair_gives_what_the_rectified_one_gives(client, rectifying):
    folder = real_scene_folder('../sequences/euroc_raw_excerpt')
    raw, = client.exchange(_raw_pair(folder, 0))
    assert raw.f == pytest.approx(436.2, abs=0.1) and raw.t == pytest.approx(0.11008, abs=1e-5)
    assert client.set(inputs__rectify=False)[0].successful
    messages, scene = _raw_pair(folder, 0), next(iterate_folder(folder))
    stamp = messages['left/image_rect'].header.stamp
    for topic, view in zip(IMAGES, (scene.pair.left, scene.pair.right), strict=True):
        messages[topic] = image_message(view, 'mono8', stamp.sec * 10 ** 9 + stamp.nanosec)
    rectified, = client.exchange(messages)
    np.testing.assert_array_equal(floats(raw.image), floats(rectified.image))


def test_raw_images_that_are_taken_for_rectified_ones_are_told(client):
    folder = real_scene_folder('../sequences/euroc_raw_excerpt')
    for number in range(FRAMES_LOOKED_AT):
        client.exchange(_raw_pair(folder, number))
    client.until(lambda: 'set inputs.rectify to true' in diagnosis(client).message, 15.0,
                 lambda: diagnosis(client).message)


def test_a_calibration_that_cannot_rectify_is_refused_and_counted(client, rectifying):
    messages = good_pair()  # R of the harness is all zeros
    client.send(messages)
    client.until(lambda: 'inputs.rectify' in diagnosis(client).message, 15.0,
                 lambda: diagnosis(client).message)

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

"""Faults of cameras through the node: diagnostics and metrics say what is wrong, what to do."""

from dataclasses import replace
import time

from harness import stereo_messages
from live_harness import Harness, PAIR
import numpy as np
import pytest
from stereo_msgs.msg import DisparityImage

from stereo_refine_ros.health_advice import FRAMES_LOOKED_AT
from stereo_refine_ros.messages.images import fill_image
from stereo_refine_ros.pipeline import StereoRefiner
from stereo_refine_ros.types import PairHealth

pytestmark = pytest.mark.ros
OK, WARN, ERROR = b'\x00', b'\x01', b'\x02'
HEALTHY = PairHealth(
    row_offset_px=0.1, gain_ratio=1.0, noise_sigma=1.0, matched_ratio=0.8,
    last_disparity_ratio=0.0, upside_down_ratio=0.1, swapped_ratio=0.1, sharpness_ratio=0.9,
    contrast_left=50.0, contrast_right=50.0)


@pytest.fixture(scope='module')
def harness():
    made = Harness()
    made.client.exchange(made.pair(), timeout_s=60.0)
    yield made
    made.close()


@pytest.fixture
def external_harness(harness):
    assert harness.client.set_atomically(matching__method='external').successful
    harness.client.connect(['preliminary/disparity'])
    yield harness
    assert harness.client.set_atomically(matching__method='scanline').successful


@pytest.fixture
def measured(monkeypatch):
    """Let the pipeline find what a test says it found, whatever the images hold."""
    found = {}
    process = StereoRefiner.process

    def measure(refiner, *args, **kwargs):
        result = process(refiner, *args, **kwargs)
        ratio = found.get('lr_consistent_ratio', 0.85)
        health = {key: value for key, value in found.items() if key != 'lr_consistent_ratio'}
        return replace(result, health=replace(HEALTHY, **health), lr_consistent_ratio=ratio)
    monkeypatch.setattr(StereoRefiner, 'process', measure)
    return found


def metrics_of(harness, messages):
    return harness.client.exchange(messages, ('metrics',), 60.0)[0].status[0]


def settle(harness, make_pair, level, text):
    """Send pairs until both topics say `text` at a level; return what the metrics said."""
    client, end = harness.client, time.monotonic() + 60.0
    said = [metrics_of(harness, make_pair()) for _ in range(FRAMES_LOOKED_AT)]
    assert (said[-1].level, text in said[-1].message) == (level, True), said[-1].message
    client.received['/diagnostics'].clear()
    while not any(message.status[0].level == level and text in message.status[0].message
                  for message in client.received['/diagnostics']):
        metrics_of(harness, make_pair())
        assert time.monotonic() < end, client.received['/diagnostics'][-1:]
    return said


@pytest.mark.parametrize('level,text,found', [
    (ERROR, 'the right image shows nothing', {'contrast_right': 0.1, 'lr_consistent_ratio': .07}),
    (ERROR, 'the right image has only 8 % of the contrast',
     {'contrast_right': 4.0, 'lr_consistent_ratio': 0.01}),
    (ERROR, 'left and right are the same image',
     {'is_same_image': True, 'lr_consistent_ratio': 1.0}),
    (ERROR, 'the right image is upside down',
     {'upside_down_ratio': 0.7, 'matched_ratio': 0.1, 'lr_consistent_ratio': 0.1}),
    (ERROR, 'left and right are exchanged',
     {'swapped_ratio': 0.7, 'matched_ratio': 0.1, 'lr_consistent_ratio': 0.1}),
    (ERROR, 'only 11 % of the pixels match',
     {'lr_consistent_ratio': 0.11, 'matched_ratio': 0.1}),
    (WARN, 'the rows of left and right are up to 3.0 px apart', {'row_offset_px': 3.0}),
    (WARN, 'the right image is 1.40 times as bright', {'gain_ratio': 1.4}),
    (WARN, 'its lens is dirty', {'sharpness_ratio': 0.2}),
    (WARN, 'things are nearer than it', {'last_disparity_ratio': 0.3})])
def test_a_fault_is_said_with_what_to_do_and_forgotten(harness, measured, level, text, found):
    measured.update(found)
    said = settle(harness, harness.pair, level, text)
    assert said[0].level == OK  # one frame raises nothing
    measured.clear()
    settle(harness, harness.pair, OK, 'refin')


def raw_pair(harness):
    sent = harness.pair()
    sent['left/camera_info'].d = [-0.3, 0.1, 0.0, 0.0, 0.0]
    return sent


def test_raw_images(harness, measured):
    measured['lr_consistent_ratio'] = 0.45
    measured['row_offset_px'] = float('nan')
    settle(harness, lambda: raw_pair(harness), WARN, 'set inputs.rectify to true')
    settle(harness, harness.pair, OK, 'refin')


def test_a_right_camera_that_hangs(harness, measured):
    frozen = PAIR[1]

    def pair():
        sent = harness.pair()
        moving = np.roll(PAIR[0], harness.stamp // 33_000_000 % 7, axis=0)
        return {**sent, **{topic: message for topic, message in stereo_messages(
            moving, frozen, harness.stamp).items() if 'image' in topic}}
    settle(harness, pair, ERROR, 'the right image is frozen')
    settle(harness, harness.pair, OK, 'refin')


def test_a_black_right_view_is_told_without_any_help(harness):
    """With what the pipeline itself finds."""
    def pair():
        sent = harness.pair()
        return {**sent, **{topic: message for topic, message in stereo_messages(
            PAIR[0], np.zeros_like(PAIR[1]), harness.stamp).items() if 'image' in topic}}
    settle(harness, pair, ERROR, '')
    settle(harness, harness.pair, OK, 'refin')


@pytest.mark.parametrize('level,text,found', [
    (ERROR, 'does not fit these images (agrees with 4 %', {'given_agreement': 0.04}),
    (WARN, 'fits the right image better than the left', {'fits_right_better': True})])
def test_a_map_that_does_not_belong_to_the_images(external_harness, measured, level, text, found):
    def pair():
        sent = external_harness.pair()
        message = DisparityImage(f=200.0, t=0.1, min_disparity=0.0, max_disparity=15.0)
        message.header = sent['left/image_rect'].header
        fill_image(message.image, np.full(PAIR[0].shape[:2], 6.0, np.float32), '32FC1')
        return {**sent, 'preliminary/disparity': message}
    measured.update(found)
    settle(external_harness, pair, level, text)
    measured.clear()
    settle(external_harness, pair, OK, 'refin')

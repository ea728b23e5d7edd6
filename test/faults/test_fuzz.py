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

"""The fuzzer on a small budget, and what it has found so far."""

import json
from pathlib import Path
import subprocess
import sys

from harness import camera_info, stereo_messages, textured_pair
from hypothesis import given, settings, strategies as st
import numpy as np
import pytest
from sensor_msgs.msg import CameraInfo, Image

from stereo_refine_ros.camera_info import stereo_geometry
from stereo_refine_ros.encodings import BadMessage, decode_image, ENCODINGS
from stereo_refine_ros.messages.disparity import read_disparity
from stereo_refine_ros.node.calibration import Calibration
from stereo_refine_ros.node.frame import check_frame, decode_frame
from stereo_refine_ros.pairing import MessageSet

pytestmark = pytest.mark.ros
FUZZ = Path(__file__).resolve().parents[2] / 'reliability' / 'fuzz.py'


def test_fuzzer_finds_nothing(tmp_path):
    found = tmp_path / 'counts.json'
    done = subprocess.run(
        [sys.executable, str(FUZZ), '--count', '6000', '--sets', '1500', '--external', '600',
         '--compressed', '0', '--seed', '20', '--json', str(found)],
        capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, done.stdout + done.stderr
    counts = json.loads(found.read_text(encoding='utf-8'))
    assert not any('violations' in part for part in counts.values())
    answered = sum(n for key, n in counts['node'].items() if key.startswith('answered'))
    refused = sum(n for key, n in counts['node'].items() if key.startswith('refused'))
    assert answered + refused == 1500
    assert min(counts['node'][f'counted: {reason}'] for reason in (
        'encoding', 'zero_size', 'too_large', 'step', 'data_size', 'size_differs',
        'camera_info_size', 'baseline')) > 0
    # What never paired up was neither answered nor counted as received.
    assert refused == counts['node']['refused: one stamp'] + sum(
        n for key, n in counts['node'].items()
        if key.startswith('counted') and 'published' not in key)


def test_fuzzer_finds_nothing_in_compressed_images(tmp_path):
    found = tmp_path / 'counts.json'
    done = subprocess.run(
        [sys.executable, str(FUZZ), '--count', '8000', '--sets', '0', '--external', '0',
         '--compressed', '600', '--seed', '20', '--json', str(found)],
        capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, done.stdout + done.stderr
    counts = json.loads(found.read_text(encoding='utf-8'))
    assert counts['conversions']['converted'] > 1000
    files = counts['compressed']
    assert files['answered: whole'] == files['counted: published'] > 100
    assert all(files[f'refused: {name}'] > 50 for name in (
        'bomb', 'cut off', 'another size', 'no image'))
    assert min(files[f'counted: {reason}'] for reason in (
        'encoding', 'too_large', 'data_size', 'size_differs')) > 0


small = st.integers(0, 12)


@settings(max_examples=300, deadline=None)
@given(width=small, height=small, step=st.integers(0, 64), data=st.binary(max_size=200),
       encoding=st.sampled_from([*ENCODINGS, 'mono', '']), is_bigendian=st.integers(0, 255))
def test_any_image_decodes_to_its_size_or_is_refused(
        width, height, step, data, encoding, is_bigendian):
    message = Image(width=width, height=height, step=step, encoding=encoding,
                    is_bigendian=is_bigendian)
    message.data.frombytes(data)
    try:
        pixels = decode_image('image', message)
    except BadMessage:
        return
    layout = ENCODINGS[encoding]
    assert pixels.shape[:2] == (height, width) and pixels.dtype == f'u{layout.item_bytes}'
    assert len(data) in (step * height * layout.rows, width * height * layout.rows)


numbers = st.floats(width=64) | st.sampled_from([0.0, 100.0, -10.0])


@settings(max_examples=300, deadline=None)
@given(st.lists(numbers, min_size=11, max_size=13), st.integers(0, 2 ** 32 - 1))
def test_any_projection_gives_a_usable_geometry_or_is_refused(p, binning):
    left, right = camera_info(16, 8, 1), CameraInfo(binning_x=binning % 3)
    right.p = p
    right.roi.x_offset = binning
    try:
        found = stereo_geometry(left, right, 16, 8)
    except BadMessage:
        return
    assert 0 < found.focal_px < 1e7 and 0 < found.baseline_m < 1e5
    assert abs(found.doffs_px) < 1e7


def frame_of(messages):
    calibration = Calibration(messages['left/camera_info'], messages['right/camera_info'])
    return check_frame(MessageSet(1, messages), calibration)


@pytest.mark.parametrize('index,value', [
    (0, 5e-324), (5, 1e300), (2, 1e300), (6, float('nan')), (3, -5e-324)])
def test_numbers_that_would_overflow_give_no_depth(index, value):
    messages = stereo_messages(*textured_pair(), 1)
    messages['right/camera_info'].p[index] = value
    frame = frame_of(messages)
    assert frame.geometry is None
    assert not decode_frame(frame).has_depth


def test_a_baseline_that_would_overflow_is_refused():
    messages = stereo_messages(*textured_pair(), 1)
    messages['right/camera_info'].p[3] = -1e300
    with pytest.raises(BadMessage) as refused:
        frame_of(messages)
    assert refused.value.reason == 'baseline'


def test_a_projection_of_wrong_length_gives_no_depth():
    messages = stereo_messages(*textured_pair(), 1)
    messages['left/camera_info'].p = [100.0, 0.0, 8.0]
    note, = frame_of(messages).notes
    assert 'disparity comes without depth: left/camera_info: P has 3 values' in note.text


def test_a_declared_range_that_no_float_holds_is_no_range():
    from test_node_process import external_messages
    message = external_messages(np.full((8, 16), 6.0), 1)['preliminary/disparity']
    message.min_disparity, message.max_disparity = -1e300, 1e300
    message.f, message.t = 1e300, float('inf')
    back = read_disparity('d', message)
    assert not back.has_range and np.isnan([back.focal_px, back.baseline_m]).all()
    assert (back.values == 6.0).all()


def test_a_disparity_wider_than_the_image_is_invalid():
    from test_node_process import external_messages
    values = np.full((96, 160), 6.0)
    values[0, :3] = 160.0, 161.0, 5e4
    sent = external_messages(values, 1, max_disparity=1e5)
    sent = {topic: sent[topic] for topic in ('left/image_rect', 'preliminary/disparity')}
    found = decode_frame(check_frame(MessageSet(1, sent), Calibration())).preliminary
    np.testing.assert_array_equal(found[0, :4], np.float32([160.0, np.nan, np.nan, 6.0]))

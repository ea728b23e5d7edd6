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

"""DisparityImage and CameraInfo: written as stereo_image_proc does, read from anybody."""

import math

from harness import camera_info, floats, stamp_of
import numpy as np
import pytest
from sensor_msgs.msg import CameraInfo
from std_msgs.msg import Header
from stereo_msgs.msg import DisparityImage

from stereo_refine_ros.camera_info import stereo_geometry
from stereo_refine_ros.encodings import BadMessage
from stereo_refine_ros.messages.disparity import (
    disparity_message, read_disparity, resize_disparity)
from stereo_refine_ros.messages.images import fill_image
from stereo_refine_ros.types import DisparityMap, StereoGeometry

NAN = np.nan
VALUES = np.array([[3.0, NAN, 5.5], [10.25, 18.0, 4.0]], np.float32)
SHIFTED = StereoGeometry(500.0, 0.12, 320.0, 240.0, 317.5)


def received(values, **fields):
    message = DisparityImage(f=500.0, t=0.12, min_disparity=0.0, max_disparity=63.0)
    for name, value in fields.items():
        setattr(message, name, value)
    fill_image(message.image, np.asarray(values, np.float32), '32FC1')
    return message


def test_message_fields_and_values():
    header = Header(stamp=stamp_of(12_000_000_034), frame_id='left_optical')
    message = disparity_message(DisparityMap(VALUES, 3, 16), SHIFTED, header)
    assert message.header == header and message.image.header == header
    assert message.image.encoding == '32FC1' and message.image.is_bigendian == 0
    assert (message.image.height, message.image.width, message.image.step) == (2, 3, 12)
    assert message.f == 500.0 and message.t == pytest.approx(0.12)
    assert (message.min_disparity, message.max_disparity) == (0.5, 15.5)
    assert message.delta_d == 1 / 16
    window = message.valid_window
    assert (window.x_offset, window.y_offset, window.width, window.height) == (0, 0, 3, 2)
    np.testing.assert_array_equal(
        floats(message.image), [[0.5, -0.5, 3.0], [7.75, 15.5, 1.5]])


def test_the_mark_of_invalid_is_the_only_smallest_value():
    values = np.array([[-7.0, 1.999, 2.0, NAN, 2.001]], np.float32)
    message = disparity_message(
        DisparityMap(values, 3, 16), StereoGeometry(1.0, 1.0, 0.0, 0.0, 0.0), Header())
    np.testing.assert_allclose(floats(message.image), [[2.0, 2.0, 2.0, 2.0, 2.001]])


def test_our_own_message_reads_back():
    geometry = StereoGeometry(500.0, 0.12, 320.0, 240.0, 320.0)
    message = disparity_message(DisparityMap(VALUES, 3, 16), geometry, Header())
    back = read_disparity('d', message)
    np.testing.assert_array_equal(back.values, VALUES)
    assert (back.focal_px, back.min_disparity, back.max_disparity) == (500.0, 3.0, 18.0)
    assert back.baseline_m == pytest.approx(0.12)


@pytest.mark.parametrize('mark', [-1.0, math.nan, math.inf, -math.inf, -16.0, 1e9])
def test_marks_of_invalid_pixels(mark):
    back = read_disparity('d', received([[mark, 0.0, 7.0]]))
    np.testing.assert_array_equal(back.values, [[NAN, 0.0, 7.0]])


def test_zero_is_a_mark_where_no_other_is_used():
    np.testing.assert_array_equal(
        read_disparity('d', received([[0.0, 7.0, 9.0]])).values, [[NAN, 7.0, 9.0]])


def test_an_undeclared_range_makes_zero_a_mark():
    back = read_disparity('d', received([[0.0, -2.0, 9.0]], min_disparity=0.0, max_disparity=0.0))
    np.testing.assert_array_equal(back.values, [[NAN, -2.0, 9.0]])
    assert not back.has_range


def test_negative_baselines_lose_their_sign():
    assert read_disparity('d', received([[7.0]], t=-0.12)).baseline_m == pytest.approx(0.12)


@pytest.mark.parametrize('value', [0.0, math.nan, math.inf])
def test_focal_lengths_and_baselines_that_say_nothing(value):
    back = read_disparity('d', received([[7.0]], f=value, t=value))
    assert math.isnan(back.focal_px) and math.isnan(back.baseline_m)


@pytest.mark.parametrize('stored', ['<f4', '>f4'])
def test_a_bigendian_flag_is_believed_only_if_values_make_sense(stored):
    values = np.array([[3.0, 7.25, 60.0, -1.0]])
    message = received(values)
    message.image.is_bigendian = 1
    message.image.data = list(values.astype(stored).tobytes())
    np.testing.assert_array_equal(read_disparity('d', message).values, [[3.0, 7.25, 60.0, NAN]])


@pytest.mark.parametrize('change,reason', [
    ({'encoding': 'mono8'}, 'encoding'), ({'step': 8}, 'step'), ({'height': 3}, 'data_size'),
    ({'width': 0}, 'zero_size'), ({'width': 2 ** 31}, 'too_large')])
def test_refusals(change, reason):
    message = received(VALUES)
    for name, value in change.items():
        setattr(message.image, name, value)
    with pytest.raises(BadMessage) as error:
        read_disparity('d', message)
    assert error.value.reason == reason


def test_resizing_scales_disparities_with_the_width():
    resized = resize_disparity(np.array([[2.0, NAN], [4.0, 6.0]], np.float32), 4, 2)
    np.testing.assert_array_equal(
        resized, [[4.0, 4.0, NAN, NAN], [8.0, 8.0, 12.0, 12.0]])


def infos(**right):
    left = camera_info(640, 480, 0, focal=500.0, cx=320.0)
    return left, camera_info(640, 480, 0, **{
        'focal': 500.0, 'cx': 317.5, 'baseline': 0.12, **right})


def test_geometry_from_camera_infos():
    geometry = stereo_geometry(*infos(), 640, 480)
    assert geometry.focal_px == 500.0 and geometry.fy == 500.0
    assert geometry.baseline_m == pytest.approx(0.12)
    assert (geometry.cx_left, geometry.cx_right, geometry.cy) == (320.0, 317.5, 240.0)
    assert geometry.doffs_px == -2.5


def test_regions_of_interest_and_binning():
    left, right = infos()
    for info, offset in ((left, 100), (right, 90)):
        info.roi.x_offset, info.roi.y_offset = offset, 40
        info.roi.width, info.roi.height = 400, 300
        info.binning_x, info.binning_y = 2, 3
    geometry = stereo_geometry(left, right, 200, 100)
    assert (geometry.focal_px, geometry.fy) == (250.0, pytest.approx(500 / 3))
    assert geometry.baseline_m == pytest.approx(0.12)
    assert (geometry.cx_left, geometry.cx_right) == (110.0, 113.75)
    assert geometry.cy == pytest.approx(200 / 3)


def test_a_camera_info_without_size_is_taken():
    left, right = infos()
    left.width = left.height = right.width = right.height = 0
    assert stereo_geometry(left, right, 640, 480).focal_px == 500.0


@pytest.mark.parametrize('change,reason', [
    ({'focal': 0.0}, 'focal_length'), ({'focal': -5.0}, 'focal_length'),
    ({'focal': math.nan}, 'focal_length'), ({'focal': math.inf}, 'focal_length'),
    ({'cx': math.nan}, 'focal_length'), ({'baseline': 0.0}, 'no_baseline'),
    ({'baseline': -0.12}, 'baseline'), ({'baseline': math.nan}, 'baseline'),
    ({'baseline': math.inf}, 'baseline')])
def test_calibrations_that_are_refused(change, reason):
    with pytest.raises(BadMessage) as error:
        stereo_geometry(*infos(**change), 640, 480)
    assert error.value.reason == reason


def test_an_uncalibrated_camera_is_refused():
    with pytest.raises(BadMessage) as error:
        stereo_geometry(CameraInfo(), CameraInfo(), 640, 480)
    assert error.value.reason == 'focal_length'


def test_camera_infos_of_another_image_size_are_refused():
    left, right = infos()
    with pytest.raises(BadMessage) as error:
        stereo_geometry(left, right, 320, 240)
    assert error.value.reason == 'camera_info_size'

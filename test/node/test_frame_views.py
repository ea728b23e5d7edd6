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

"""What is shown of a frame: the sure part of the map, its confidence, limits and companions."""

from dataclasses import replace

from harness import camera_info, floats
import numpy as np
import pytest

from stereo_refine_ros.node.calibration import Calibration
from stereo_refine_ros.node.frame import DecodedFrame, Frame
from stereo_refine_ros.node.views import missing_for, RefinedFrame, sure_part, VIEWS
from stereo_refine_ros.params import load_preset
from stereo_refine_ros.types import (
    DisparityMap, PlaneSegmentation, RefinementResult, StereoGeometry, StereoPair)

pytestmark = pytest.mark.ros
GEOMETRY = StereoGeometry(200.0, 0.1, 1.0, 0.5, 1.0)
NAN = np.float32(np.nan)


def refined(values, confidence, **parameters):
    values, confidence = np.asarray(values, np.float32), np.asarray(confidence, np.float32)
    params = load_preset('live', {
        name.replace('__', '.'): value for name, value in parameters.items()})
    found = DisparityMap(values, 0, 16)
    segments = PlaneSegmentation(
        np.zeros(values.shape, np.int32), np.full((1, 3), np.nan), np.zeros(1, bool),
        np.zeros(1, np.float32))
    result = RefinementResult(found, found, segments, 0.9, confidence=confidence)
    pair = StereoPair(np.zeros(values.shape, np.uint8), np.zeros(values.shape, np.uint8))
    info = camera_info(values.shape[1], values.shape[0], 7)
    frame = Frame(camera_info(1, 1, 9).header, GEOMETRY, None, calibration=Calibration(info, info))
    return RefinedFrame(frame, DecodedFrame(pair, GEOMETRY), params, result,
                        sure_part(result, params.output.min_confidence))


def test_what_is_less_sure_than_asked_is_not_published():
    values, confidence = [[4.0, 5.0, NAN, 8.0]], [[0.4, 0.5, 0.9, 1.0]]
    frame = refined(values, confidence)
    np.testing.assert_array_equal(frame.published.values, np.float32([[NAN, 5.0, NAN, 8.0]]))
    np.testing.assert_array_equal(
        floats(VIEWS['depth'](frame)), np.float32([[NAN, 4.0, NAN, 2.5]]))
    assert (VIEWS['disparity/color'](frame).data[:3].tolist(),
            min(VIEWS['disparity/color'](frame).data[9:12])) != ([0, 0, 0], 0)
    np.testing.assert_array_equal(  # what came in stays as it came
        floats(VIEWS['disparity/preliminary'](frame).image), [[4.0, 5.0, -1.0, 8.0]])


def test_zero_publishes_the_dense_map():
    values = [[4.0, 5.0, 8.0]]
    frame = refined(values, [[0.0, NAN, 1.0]], output__min_confidence=0.0)
    assert frame.published is frame.result.disparity


def test_confidence_goes_out_as_it_is():
    message = VIEWS['confidence'](refined([[1.0, 2.0]], [[0.25, 1.0]]))
    np.testing.assert_array_equal(floats(message), np.float32([[0.25, 1.0]]))
    assert message.header == camera_info(1, 1, 9).header


@pytest.mark.parametrize('farthest,expected', [
    (0.0, [4.0, 2.5, 20.0]), (4.0, [4.0, 2.5, NAN]), (3.0, [NAN, 2.5, NAN])])
def test_points_end_at_the_farthest_depth(farthest, expected):
    frame = refined([[5.0, 8.0, 1.0]], np.ones((1, 3)), output__max_depth=farthest)
    cloud = VIEWS['points'](frame)
    found = np.frombuffer(cloud.data, np.float32).reshape(1, 3, 4)
    np.testing.assert_array_equal(found[0, :, 2], np.float32(expected))
    np.testing.assert_array_equal(np.isnan(found[0, :, 0]), np.isnan(expected))
    np.testing.assert_array_equal(  # the depth image is not cut
        floats(VIEWS['depth'](frame)), np.float32([[4.0, 2.5, 20.0]]))


def test_depth_has_its_camera_info():
    frame = refined([[5.0]], [[1.0]])
    info = VIEWS['depth/camera_info'](frame)
    assert info.header == VIEWS['depth'](frame).header
    assert (info.width, info.height, list(info.p)) == (1, 1, list(frame.frame.calibration.left.p))
    assert frame.frame.calibration.left.header.stamp.nanosec == 7  # not written to


def test_what_a_view_lacks_is_said():
    frame = refined([[5.0]], [[1.0]])
    assert {missing_for(topic, frame) for topic in VIEWS} == {''}
    lost = replace(frame, frame=replace(frame.frame, calibration=Calibration()),
                   decoded=replace(frame.decoded, has_principal_point=False))
    assert {topic for topic in VIEWS if missing_for(topic, lost)} == {
        'planes', 'points', 'depth/camera_info'}
    blind = replace(frame, decoded=replace(
        frame.decoded, geometry=StereoGeometry(0.0, 0.0, 1.0, 0.5, 1.0)))
    assert {topic for topic in VIEWS if missing_for(topic, blind)} == {
        'planes', 'points', 'depth'}
    assert 'camera.baseline and camera.focal_length' in missing_for('depth', blind)

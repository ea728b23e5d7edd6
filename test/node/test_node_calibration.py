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

"""Calibration through the real node: late, missing, unusable, or given by parameters."""

from harness import floats, stamp_of, stereo_messages, textured_pair
from live_node import diagnosis, GEOMETRY, good_pair, stamps
import numpy as np
import pytest
from sensor_msgs.msg import Image
from stereo_refine_ros.messages.outputs import depth_map
from stereo_refine_ros.types import DisparityMap

pytestmark = pytest.mark.ros


def test_no_usable_projection_gives_disparity_without_depth(node, client):
    def uncalibrated():
        sent = good_pair()
        for name in ('left/camera_info', 'right/camera_info'):
            sent[name].p = [0.0] * 12
        return sent
    client.subscribe('depth', Image)
    message, = client.exchange(uncalibrated())
    assert (message.f, message.t, message.min_disparity) == (0.0, 0.0, 1.0)
    assert np.median(floats(message.image)) == pytest.approx(6.0, abs=0.2)
    client.until(lambda: client.send(uncalibrated()) or 'disparity comes without depth: '
                 'left/camera_info: P has fx 0' in diagnosis(client).message, 10.0, 'a WARN')
    assert diagnosis(client).level == b'\x01'
    node.wait_log('depth is not published: focal length and baseline are not known')
    answer, = client.exchange(good_pair())
    assert answer.f == 200.0


def test_camera_info_need_not_share_the_stamp(client):
    """Stamp 0 or one a second: the newest serves, and does not hold up the images."""
    sent = good_pair()
    for name in ('left/camera_info', 'right/camera_info'):
        sent[name].header.stamp = stamp_of(0)
        sent[name].p[0] = sent[name].p[5] = 150.0
    client.send({name: sent.pop(name) for name in list(sent) if 'info' in name})
    for number in range(5):
        message, = client.exchange(sent)
        assert message.header.stamp == sent['left/image_rect'].header.stamp
        assert message.header.frame_id == 'left_optical'
        assert message.f == 150.0 or number == 0  # that one may have overtaken the camera_info
        sent = {name: item for name, item in good_pair().items() if 'info' not in name}
    client.exchange(good_pair())


def test_parameters_stand_instead_of_camera_info_and_metres_instead_of_disparities(client):
    assert client.set_atomically(
        camera__baseline=0.2, camera__focal_length=400.0, matching__nearest=4.0).successful
    sent = stereo_messages(*textured_pair(), next(stamps))
    message, = client.exchange(sent)
    assert (message.f, message.t) == (400.0, pytest.approx(0.2))
    assert message.max_disparity == 20.0
    assert client.set_atomically(
        camera__baseline=0.0, camera__focal_length=0.0, matching__nearest=0.0).successful


def test_depth_of_a_shifted_principal_point_is_metric():
    disparity = DisparityMap(np.full((1, 1), 6.0, np.float32), 0, 16)
    assert depth_map(disparity, GEOMETRY)[0, 0] == pytest.approx(200 * 0.1 / 3.5)

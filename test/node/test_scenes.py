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

"""The paper's scenes through the real node: the core's own bits and figures, and better maps."""

import time

from diagnostic_msgs.msg import DiagnosticArray
from harness import Client, floats, reliable_inputs, running_node, stamp_of
from live_node import values_of
import numpy as np
import pytest
from std_msgs.msg import Header
from stereo_msgs.msg import DisparityImage

from stereo_refine_ros.datasets import load_scene
from stereo_refine_ros.messages.scene import (
    camera_info_messages, image_message, nominal_geometry, truth_message)
from stereo_refine_ros.node.views import sure_part
from stereo_refine_ros.params import load_preset
from stereo_refine_ros.pipeline import StereoRefiner
from stereo_refine_ros.quality.frame import measure_frame

pytestmark = pytest.mark.ros


@pytest.fixture(scope='module')
def client():
    with running_node(*reliable_inputs(), '-p', 'output.min_confidence:=0.0',
                      '-p', 'temporal.enabled:=false'):
        client = Client()
        client.subscribe('disparity', DisparityImage)
        client.subscribe('metrics', DiagnosticArray)
        yield client
        client.close()


def messages_of(scene, geometry):
    height, width = scene.pair.shape
    header = Header(stamp=stamp_of(time.time_ns()), frame_id='left_optical')
    left_info, right_info = camera_info_messages(geometry, height, width, header)
    return {
        'ground_truth/disparity': truth_message(scene, geometry, header),
        'left/image_rect': image_message(scene.pair.left, 'bgr8', header),
        'right/image_rect': image_message(scene.pair.right, 'bgr8', header),
        'left/camera_info': left_info, 'right/camera_info': right_info}


@pytest.mark.parametrize('name', ['cones', 'teddy', 'venus', 'tsukuba'])
def test_a_scene_over_dds(client, name):
    scene = load_scene(name)
    geometry = scene.geometry or nominal_geometry(*scene.pair.shape)
    assert client.set(matching__num_disparities=scene.num_disparities)[0].successful
    client.connect(messages_of(scene, geometry))
    # Calibration that comes late leaves the first answer to the last scene's cameras.
    message, metrics = client.exchange_until(
        lambda: messages_of(scene, geometry), ('disparity', 'metrics'),
        lambda answers: 'mse_refined' in values_of(answers[1])
        and (answers[0].f, answers[0].min_disparity) == pytest.approx(
            (geometry.focal_px, geometry.doffs_px)))
    figures = values_of(metrics)

    params = load_preset('live', {
        'matching.num_disparities': scene.num_disparities, 'output.min_confidence': 0.0,
        'temporal.enabled': False})
    result = StereoRefiner(params).process(scene.pair.left, scene.pair.right)
    published = sure_part(result, params.output.min_confidence)
    expected = np.where(published.valid, published.values + np.float32(geometry.doffs_px),
                        np.float32(geometry.doffs_px - 1))
    np.testing.assert_array_equal(floats(message.image), expected)
    assert message.f == pytest.approx(geometry.focal_px)
    assert message.t == pytest.approx(geometry.baseline_m)

    offline = measure_frame(result, scene.pair, scene.truth, scene.scale)
    for key, value in offline.items():
        if not key.endswith('_ms'):
            assert figures[key] == pytest.approx(value, rel=1e-9, nan_ok=True), key

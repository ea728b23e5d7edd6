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

"""
The installed launch file starts the node, and its arguments reach it.

Needs ROS's launch_testing and a workspace that is built and sourced, as under `colcon test`.
"""

import importlib.util
import unittest

from harness import Client, floats, READY_S, stereo_messages, textured_pair
import numpy as np
import pytest
from sensor_msgs.msg import CameraInfo, Image
from stereo_msgs.msg import DisparityImage

launch_testing = pytest.importorskip('launch_testing', reason='launch_testing is not installed')
launch = pytest.importorskip('launch')
pytest.importorskip('launch_testing.actions')
pytest.importorskip('launch_testing.asserts')
index = pytest.importorskip('ament_index_python.packages')
try:
    SHARE = index.get_package_share_directory('stereo_refine_ros')
except index.PackageNotFoundError:
    pytest.skip('stereo_refine_ros is not in a sourced workspace', allow_module_level=True)

pytestmark = pytest.mark.ros
CHOSEN = {
    'namespace': 'front', 'left': '/zed/left', 'right': '/zed/right',
    'image': 'image_rect_color', 'preset': 'accurate', 'method': 'sgbm', 'num_disparities': '32'}
KIND_OF = {'image_rect': Image, 'camera_info': CameraInfo}
DISPARITY = 6


@pytest.mark.launch_test
def generate_test_description():
    path = f'{SHARE}/launch/stereo_refine.launch.py'
    spec = importlib.util.spec_from_file_location('stereo_refine', path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    chosen = [launch.actions.SetLaunchConfiguration(*item) for item in CHOSEN.items()]
    return launch.LaunchDescription([
        *chosen, module.generate_launch_description(), launch_testing.actions.ReadyToTest()])


class TestRunning(unittest.TestCase):
    """While the node runs."""

    @classmethod
    def setUpClass(cls):
        cls.client = Client(node_name='/front/refine_node')
        cls.client.subscribe('/front/disparity', DisparityImage)

    @classmethod
    def tearDownClass(cls):
        cls.client.close()

    def test_parameters_are_those_of_the_command_line(self):
        values = self.client.get(
            'preset', 'matching.method', 'matching.num_disparities', 'use_sim_time')
        self.assertEqual(values, ['accurate', 'sgbm', 32, False])

    def test_a_pair_of_the_camera_comes_back_as_its_disparity(self):
        left, right = textured_pair(disparity=DISPARITY)
        received = self.client.received['/front/disparity']
        topics = {name: f"/zed/{name.replace('image_rect', 'image_rect_color')}"
                  for name in stereo_messages(left, right, 1)}
        for name, topic in topics.items():
            self.client.publisher(topic, KIND_OF[name.split('/')[1]])
        sent = 0

        def answered():
            # Best effort, as a camera's driver and the node are: a pair may be lost.
            nonlocal sent
            sent += 1
            for name, message in stereo_messages(left, right, sent * 10 ** 9).items():
                self.client.publisher(topics[name]).publish(message)
            self.client.spin(0.5)
            return bool(received)

        self.client.until(answered, 5 * READY_S, 'a disparity')  # compiles first
        message = received[-1]
        self.assertEqual((message.f, round(message.t, 6)), (200.0, 0.1))
        self.assertAlmostEqual(
            float(np.median(floats(message.image)[:, 40:])), DISPARITY, delta=0.1)


@launch_testing.post_shutdown_test()
class TestEnded(unittest.TestCase):
    """After the node was told to end."""

    def test_the_node_ended_by_itself_and_well(self, proc_info):
        launch_testing.asserts.assertExitCodes(proc_info)

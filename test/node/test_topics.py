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

"""camera_info follows an image that is remapped, unless it is remapped itself."""

from harness import Client, READY_S, running_node
import pytest
import rclpy
from sensor_msgs.msg import CameraInfo, Image
from stereo_msgs.msg import DisparityImage
from stereo_refine_ros.node.topics import input_topic

pytestmark = pytest.mark.ros
IMAGE = 'left/image_rect:=/zed/left/image_rect_color'


@pytest.mark.parametrize('remappings, expected', [
    ([], {'left/camera_info': 'left/camera_info', 'left/image_rect': 'left/image_rect'}),
    ([IMAGE], {'left/camera_info': '/zed/left/camera_info', 'left/image_rect': 'left/image_rect',
               'right/camera_info': 'right/camera_info'}),
    (['right/image_rect:=image'], {'right/camera_info': '/front/camera_info'}),
    ([IMAGE, 'left/camera_info:=/calibration'], {'left/camera_info': 'left/camera_info'}),
    # As stereo_image_proc, which resolves the name that it found once more.
    ([IMAGE, '/zed/left/camera_info:=/calibration'], {'left/camera_info': '/calibration'}),
])
def test_where_an_input_is_taken_from(remappings, expected):
    context = rclpy.Context()
    context.init(['node', '--ros-args', *(part for rule in remappings for part in ('-r', rule))])
    node = rclpy.create_node('node', namespace='/front', context=context)
    try:
        assert {topic: input_topic(node, topic) for topic in expected} == expected
    finally:
        node.destroy_node()
        context.try_shutdown()


def test_the_node_listens_beside_the_images_it_is_given():
    side_of = {'left': '/zed/left', 'right': '/zed/right'}
    remapped = [part for side, place in side_of.items()
                for part in ('-r', f'{side}/image_rect:={place}/image_rect_color')]
    with running_node(*remapped, ready=False):
        client = Client()
        client.subscribe('disparity', DisparityImage)
        topics = [client.publisher(f'{place}/{name}', kind) for place in side_of.values()
                  for name, kind in (('image_rect_color', Image), ('camera_info', CameraInfo))]
        client.until(lambda: all(topic.get_subscription_count() for topic in topics),
                     READY_S, 'subscriptions beside the images')
        client.close()

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

"""camera_info follows a remapped image to where it is published."""

from contextlib import contextmanager

from harness import Client, READY_S, running_node, wait_until
import pytest
import rclpy
from sensor_msgs.msg import CameraInfo, Image
from stereo_msgs.msg import DisparityImage
from stereo_refine_ros.node.topics import input_topic

pytestmark = pytest.mark.ros
IMAGE = 'left/image_rect:=/zed/left/image_rect_color'
OWN, BESIDE = '/front/left/camera_info', '/zed/left/camera_info'


@contextmanager
def graph(*remappings, publishers=()):
    """Give a node with remappings, in a graph where camera_info is published on these topics."""
    context = rclpy.Context()
    context.init(['node', '--ros-args', *(part for rule in remappings for part in ('-r', rule))])
    node = rclpy.create_node('node', namespace='/front', context=context)
    try:
        for topic in publishers:
            node.create_publisher(CameraInfo, topic, 1)
        wait_until(lambda: all(map(node.count_publishers, publishers)), 10.0,
                   lambda: f'publishers of {publishers}')
        yield node
    finally:
        node.destroy_node()
        context.try_shutdown()


@pytest.mark.parametrize('remappings, publishers, expected', [
    ([], [BESIDE], OWN),
    ([IMAGE], [], OWN),
    ([IMAGE], [BESIDE], BESIDE),
    ([IMAGE], [OWN, BESIDE], OWN),
    ([IMAGE, 'left/camera_info:=/calibration'], [BESIDE], '/calibration'),
    # As stereo_image_proc, which resolves the name that it found once more.
    ([IMAGE, f'{BESIDE}:=/calibration'], ['/calibration'], '/calibration'),
    (['left/image_rect:=image'], ['/front/camera_info'], '/front/camera_info'),
])
def test_camera_info_follows_its_image_to_where_it_is_published(
        remappings, publishers, expected):
    with graph(*remappings, publishers=publishers) as node:
        assert input_topic(node, 'left/camera_info') == expected


def test_an_image_is_where_it_is_remapped_to():
    with graph(IMAGE, publishers=[BESIDE]) as node:
        assert input_topic(node, 'left/image_rect') == '/zed/left/image_rect_color'
        assert input_topic(node, 'right/image_rect') == '/front/right/image_rect'
        assert input_topic(node, 'right/camera_info') == '/front/right/camera_info'


def test_the_node_listens_beside_the_images_once_a_camera_is_there():
    places = {'left': '/zed/left', 'right': '/zed/right'}
    remapped = [part for side, place in places.items()
                for part in ('-r', f'{side}/image_rect:={place}/image_rect_color')]
    with running_node(*remapped, ready=False):
        client = Client()
        client.subscribe('disparity', DisparityImage)
        own = [client.publisher(f'{side}/image_rect_color', Image) for side in places.values()]
        client.until(lambda: all(topic.get_subscription_count() for topic in own), READY_S,
                     'subscriptions to the images')
        # A camera that starts late, one topic after another.
        beside = [client.publisher(f'{place}/camera_info', CameraInfo)
                  for place in places.values()]
        client.until(lambda: all(topic.get_subscription_count() for topic in beside), READY_S,
                     'subscriptions beside the images')
        client.close()

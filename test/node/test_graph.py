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

"""The node asks the ROS graph before it gives advice."""

from harness import Client
import pytest
import rclpy
from sensor_msgs.msg import CompressedImage, Image
from stereo_msgs.msg import DisparityImage

from stereo_refine_ros.node.graph import explain_silence, feedback, rivals

pytestmark = pytest.mark.ros


@pytest.fixture
def client():
    made = Client()
    yield made
    made.close()


@pytest.fixture
def other(client):
    """Another node, in the context of the first."""
    made = rclpy.create_node('driver', namespace='camera', context=client.context)
    yield made
    made.destroy_node()


def until_seen(client, *names):
    client.until(lambda: all(client.node.count_publishers(name) for name in names), 10.0,
                 lambda: f'publishers of {names}')


def silence(client, topic='left/image_rect', kind=Image):
    return explain_silence(client.node, topic, client.node.resolve_topic_name(topic), kind)


def test_nobody_publishes_and_nothing_is_alike(client):
    assert silence(client) == (
        'nobody publishes /left/image_rect: start the camera, or remap the topic (`ros2 topic '
        'list` shows what is there)')


@pytest.mark.parametrize('name', ['/camera/left/image_rect', '/zed/left/image_rect_color'])
def test_a_like_named_topic_is_pointed_to(client, other, name):
    other.create_publisher(Image, name, 1)
    other.create_publisher(Image, '/zed/right/image_rect_color', 1)
    until_seen(client, name, '/zed/right/image_rect_color')
    assert silence(client) == (f'nobody publishes /left/image_rect; {name} is there: remap with '
                               f'`-r left/image_rect:={name}`')


def test_a_compressed_topic_is_pointed_to(client, other):
    other.create_publisher(CompressedImage, '/left/image_rect/compressed', 1)
    until_seen(client, '/left/image_rect/compressed')
    assert silence(client).endswith(
        '/left/image_rect/compressed is there: set inputs.image_transport to compressed')


def test_a_plain_topic_is_pointed_to_where_compressed_ones_are_wanted(client, other):
    other.create_publisher(Image, '/left/image_rect', 1)
    until_seen(client, '/left/image_rect')
    assert silence(client, 'left/image_rect/compressed', CompressedImage).endswith(
        '/left/image_rect is there: set inputs.image_transport to raw')


def test_another_type_is_named(client, other):
    other.create_publisher(Image, '/preliminary/disparity', 1)
    until_seen(client, '/preliminary/disparity')
    assert silence(client, 'preliminary/disparity', DisparityImage) == (
        '/preliminary/disparity is published as sensor_msgs/msg/Image by /camera/driver, '
        'stereo_msgs/msg/DisparityImage is wanted: remap preliminary/disparity to a topic of '
        'that type')


def test_a_publisher_that_sends_nothing_is_named(client, other):
    other.create_publisher(Image, '/left/image_rect', 1)
    until_seen(client, '/left/image_rect')
    assert silence(client).startswith('/camera/driver publishes /left/image_rect and sends')


def test_somebody_else_on_an_output_is_a_rival(client, other):
    client.node.create_publisher(DisparityImage, 'disparity', 1)
    until_seen(client, '/disparity')
    assert rivals(client.node, ['disparity', 'depth']) == []
    other.create_publisher(DisparityImage, '/disparity', 1)
    client.until(lambda: client.node.count_publishers('disparity') == 2, 10.0, 'a rival')
    assert rivals(client.node, ['disparity', 'depth']) == [
        '/camera/driver publishes /disparity too, and readers get a mixture: remap disparity of '
        'one of the two']


def test_an_output_that_comes_back_as_an_input_is_named(client, other):
    client.node.create_publisher(DisparityImage, 'preliminary/disparity', 1)
    other.create_publisher(Image, '/left/image_rect', 1)
    until_seen(client, '/preliminary/disparity', '/left/image_rect')
    found, = feedback(client.node, ['left/image_rect', 'preliminary/disparity'])
    assert found.startswith("/preliminary/disparity is this node's own output and its input")

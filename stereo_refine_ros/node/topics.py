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

"""Which topic an input is taken from, after remapping."""

from __future__ import annotations

from rclpy.node import Node

_IMAGE_OF = {'left/camera_info': 'left/image_rect', 'right/camera_info': 'right/image_rect'}


def input_topic(node: Node, topic: str) -> str:
    """
    Name the topic to subscribe to: camera_info follows its image, as stereo_image_proc's does.

    It does so only while somebody publishes there and nobody under its own name.

    Parameters
    ----------
    node : rclpy.node.Node
        Knows the remappings and the ROS graph.
    topic : str
        Name of an input, relative.

    Returns
    -------
    str
        The absolute name.

    """
    own, image = node.resolve_topic_name(topic), _IMAGE_OF.get(topic)
    if image is None or _is_remapped(node, topic) or not _is_remapped(node, image):
        return own
    folder = node.resolve_topic_name(image).rpartition('/')[0]
    beside = node.resolve_topic_name(f'{folder}/camera_info')
    follows = node.count_publishers(beside) and not node.count_publishers(own)
    return beside if follows else own


def _is_remapped(node: Node, topic: str) -> bool:
    return node.resolve_topic_name(topic) != node.resolve_topic_name(topic, only_expand=True)

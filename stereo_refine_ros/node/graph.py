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

"""What the ROS graph says before the node gives advice: who publishes what, under which name."""

from __future__ import annotations

from collections.abc import Iterable

from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo


def type_name(kind: type) -> str:
    """Name a message type as `ros2 topic info` does."""
    return f'{kind.__module__.split(".")[0]}/msg/{kind.__name__}'


def explain_silence(node: Node, topic: str, name: str, kind: type) -> str:
    """
    Say why nothing may come on a topic, and what to do.

    Parameters
    ----------
    node : rclpy.node.Node
        That listens.
    topic : str
        As the node calls it.
    name : str
        Its full name, remapped.
    kind : type
        Of the messages wanted.

    """
    wanted = type_name(kind)
    publishers = node.get_publishers_info_by_topic(name)
    if not publishers:
        return f'nobody publishes {name}{_alternatives(node, topic, name, wanted)}'
    types = sorted({info.topic_type for info in publishers})
    if wanted not in types:
        return (f'{name} is published as {", ".join(types)} by {_names(publishers)}, '
                f'{wanted} is wanted: remap {topic} to a topic of that type')
    return (f'{_names(publishers)} publishes {name} and sends nothing, or nothing that arrives: '
            f'`ros2 topic hz {name}` tells; then check QoS and, for large images, the Fast DDS '
            'profile in config/')


def rivals(node: Node, topics: Iterable[str]) -> list[str]:
    """Name the outputs that somebody else publishes too: readers would get a mixture."""
    found = []
    for topic in topics:
        name = node.resolve_topic_name(topic)
        if node.count_publishers(name) < 2:
            continue
        others = [info for info in node.get_publishers_info_by_topic(name)
                  if _full_name(info) != node.get_fully_qualified_name()]
        if others:
            found.append(f'{_names(others)} publishes {name} too, and readers get a mixture: '
                         f'remap {topic} of one of the two')
    return found


def feedback(node: Node, inputs: Iterable[str]) -> list[str]:
    """Name the inputs on which the node's own output comes back."""
    me = node.get_fully_qualified_name()
    return [f"{node.resolve_topic_name(topic)} is this node's own output and its input "
            f'{topic} at once: remap one of them'
            for topic in inputs
            if any(_full_name(info) == me
                   for info in node.get_publishers_info_by_topic(node.resolve_topic_name(topic)))]


def _alternatives(node: Node, topic: str, name: str, wanted: str) -> str:
    """Point to a topic that is there and may be meant."""
    present = {found: types for found, types in node.get_topic_names_and_types()
               if node.count_publishers(found) > 0}
    if f'{name}/compressed' in present:
        return f'; {name}/compressed is there: set inputs.image_transport to compressed'
    if name.removesuffix('/compressed') != name and name.removesuffix('/compressed') in present:
        return f'; {name.removesuffix("/compressed")} is there: set inputs.image_transport to raw'
    side = topic.partition('/')[0]
    alike = [found for found, types in present.items()
             if wanted in types and found != name and side in found.strip('/').split('/')]
    if not alike:
        alike = [found for found, types in present.items()
                 if wanted in types and found.rpartition('/')[2] == name.rpartition('/')[2]]
    if not alike:
        return ': start the camera, or remap the topic (`ros2 topic list` shows what is there)'
    best = max(alike, key=lambda found: found.endswith(name.rpartition('/')[2]))
    return f'; {best} is there: remap with `-r {topic}:={best}`'


def _full_name(info: TopicEndpointInfo) -> str:
    return f'{info.node_namespace.rstrip("/")}/{info.node_name}'


def _names(publishers: Iterable[TopicEndpointInfo]) -> str:
    return ' and '.join(sorted({_full_name(info) for info in publishers}))

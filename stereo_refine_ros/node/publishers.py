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

"""Everything the node publishes, and who listens."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.event_handler import PublisherEventCallbacks, UnsupportedEventTypeError
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from stereo_msgs.msg import DisparityImage
from visualization_msgs.msg import MarkerArray

TOPICS: dict[str, type] = {
    'disparity': DisparityImage, 'metrics': DiagnosticArray,
    'disparity/preliminary': DisparityImage, 'disparity/color': Image, 'confidence': Image,
    'segments': Image, 'planes': MarkerArray, 'depth': Image, 'depth/camera_info': CameraInfo,
    'points': PointCloud2}


class Publishers:
    """
    Reliable publishers of depth 1, their QoS open to overrides.

    Parameters
    ----------
    node : rclpy.node.Node
    on_matched : callable
        Called in the executor when a subscriber came or went.

    """

    def __init__(self, node: Node, on_matched: Callable[[], None]) -> None:
        """Create a publisher for every topic."""
        self._on_matched = on_matched
        self._publishers = {
            name: self._create(node, name, kind) for name, kind in TOPICS.items()}

    def wants(self, topic: str) -> bool:
        """Whether somebody listens to a topic."""
        return self._publishers[topic].get_subscription_count() > 0

    def wants_any(self) -> bool:
        """Whether somebody listens to any topic."""
        return any(self.wants(topic) for topic in TOPICS)

    def publish(self, topic: str, message: Any) -> None:
        """Publish one message."""
        self._publishers[topic].publish(message)

    def _create(self, node: Node, topic: str, kind: type) -> Publisher:
        def create(events: PublisherEventCallbacks | None) -> Publisher:
            profile = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
            return node.create_publisher(
                kind, topic, profile, event_callbacks=events,
                qos_overriding_options=QoSOverridingOptions.with_default_policies())
        # Every event handler is one more thing to wait for, each time a message comes.
        try:
            return create(PublisherEventCallbacks(
                matched=lambda _: self._on_matched(), use_default_callbacks=False))
        except UnsupportedEventTypeError:
            return create(None)  # then the 1 Hz timer finds subscribers

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

"""The node behind `replay --bag`: a rosbag2 as messages, byte for byte, with a clock."""

from __future__ import annotations

from collections.abc import Collection, Iterable
import importlib
from pathlib import Path
import time
from typing import Any

from builtin_interfaces.msg import Time
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosbags.interfaces import Connection
from rosgraph_msgs.msg import Clock

from stereo_refine_ros.datasets.bag_file import bag_messages, open_bag
from stereo_refine_ros.replay.pacing import (
    REPLAY_QOS, sleep_until, wait_delivered, wait_for_subscribers)

_CLOCK_PERIOD_S = 0.01
_CLOCK_WAIT_S = 0.5
_NS = 1_000_000_000


class BagPlayer(Node):
    """
    Publish the messages of a bag (mcap or sqlite3) as they were recorded.

    Parameters
    ----------
    path : str or Path
        The bag's folder.
    topics : collection of str, optional
        Recorded names to publish; all of them by default.

    Raises
    ------
    FileNotFoundError, ValueError
        When there is no such bag, or none of its topics can be published.

    """

    def __init__(self, path: str | Path, topics: Collection[str] = ()) -> None:
        """Read the bag's list of topics and create a publisher for each."""
        super().__init__('replay')
        self._path = Path(path)
        with open_bag(self._path) as reader:
            wanted = [connection for connection in reader.connections
                      if connection.topic != '/clock' and connection.msgcount > 0
                      and (not topics or connection.topic in topics)]
        self._publishers_by_topic: dict[str, Publisher] = {}
        for connection in wanted:
            self._advertise(connection)
        if not self._publishers_by_topic:
            raise ValueError(f'bag: {path} has no messages that can be published here')
        self._clock_publisher = self.create_publisher(Clock, '/clock', 10)

    def play(self, speed: float, loops: int, wait_s: float) -> int:
        """
        Publish the bag `loops` times over; return how many messages went out.

        Parameters
        ----------
        speed : float
            1 plays as recorded, 2 twice as fast.
        loops : int
            How often, 0 for ever.
        wait_s : float
            How long to wait for subscribers first.

        """
        publishers = list(self._publishers_by_topic.values())
        if wait_s > 0 and not wait_for_subscribers(self, publishers, wait_s):
            self.get_logger().warning(
                f'nobody subscribes to {", ".join(sorted(self._publishers_by_topic))} after '
                f'{wait_s:g} s; publishing all the same (remap with --ros-args -r FROM:=TO)')
        wait_for_subscribers(self, [self._clock_publisher], min(wait_s, _CLOCK_WAIT_S))
        count = loop = 0
        while (loops == 0 or loop < loops) and self.context.ok():
            with open_bag(self._path) as reader:
                wanted = [connection for connection in reader.connections
                          if connection.topic in self._publishers_by_topic]
                count += self._play_once(bag_messages(reader, wanted), speed)
            loop += 1
        wait_delivered(self, publishers)
        return count

    def _play_once(self, messages: Iterable[tuple[Connection, int, bytes]], speed: float) -> int:
        count, now_ns, due = 0, None, time.monotonic()
        for connection, stamp_ns, raw in messages:
            if now_ns is not None and not self._advance(now_ns, stamp_ns, due, speed):
                break
            due += (stamp_ns - (now_ns or stamp_ns)) / _NS / speed
            now_ns = stamp_ns
            self._publish_clock(stamp_ns)
            self._publishers_by_topic[connection.topic].publish(bytes(raw))
            count += 1
        return count

    def _advance(self, from_ns: int, to_ns: int, start: float, speed: float) -> bool:
        """Let the bag's time run to `to_ns`, ticking the clock; False when ROS shuts down."""
        end = start + (to_ns - from_ns) / _NS / speed
        while end - time.monotonic() > _CLOCK_PERIOD_S:
            if not sleep_until(self, time.monotonic() + _CLOCK_PERIOD_S):
                return False
            played = max(0.0, time.monotonic() - start) * speed
            self._publish_clock(min(to_ns, from_ns + int(played * _NS)))
        return sleep_until(self, end)

    def _publish_clock(self, stamp_ns: int) -> None:
        seconds, nanoseconds = divmod(stamp_ns, _NS)
        self._clock_publisher.publish(Clock(clock=Time(sec=seconds, nanosec=nanoseconds)))

    def _advertise(self, connection: Connection) -> None:
        if connection.topic in self._publishers_by_topic:
            return
        kind = _message_class(connection.msgtype)
        if kind is None:
            self.get_logger().warning(
                f'{connection.topic}: {connection.msgtype} is not installed; left out')
            return
        self._publishers_by_topic[connection.topic] = self.create_publisher(
            kind, connection.topic, _qos_of(connection))


def _message_class(name: str) -> Any:
    """Return the class of `package/msg/Name`, or None where it is not installed."""
    package, _, leaf = name.partition('/msg/')
    try:
        return getattr(importlib.import_module(f'{package}.msg'), leaf)
    except (ImportError, AttributeError):
        return None


def _qos_of(connection: Connection) -> QoSProfile:
    """Keep what was latched latched, as static transforms are."""
    offered = getattr(connection.ext, 'offered_qos_profiles', None) or []
    if any(qos.durability.name == 'TRANSIENT_LOCAL' for qos in offered):
        return QoSProfile(depth=REPLAY_QOS.depth, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    return REPLAY_QOS

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

"""The node behind `replay --bag`: a rosbag2 as messages, byte for byte."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
import importlib
from pathlib import Path
import time
from typing import Any

from builtin_interfaces.msg import Time
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosbags.interfaces import Connection
from rosbags.rosbag2 import Reader
from rosgraph_msgs.msg import Clock

from stereo_refine_ros.datasets.bag_file import bag_messages, open_bag
from stereo_refine_ros.replay.keyboard import FASTER, HELP, Keyboard, NEXT, PAUSE
from stereo_refine_ros.replay.pacing import (
    REPLAY_QOS, sleep_until, wait_delivered, wait_for_subscribers)
from stereo_refine_ros.replay.timeline import Timeline

_TICK_S = 0.01
_CLOCK_WAIT_S = 0.5
_NS = 1_000_000_000


@dataclass(frozen=True)
class Excerpt:
    """
    What of a bag is played.

    Attributes
    ----------
    topics, without : tuple of str
        Recorded names to publish (all where there are none), and those left out.
    offset_s, duration_s : float
        Seconds of the bag to leave out first and to play then; 0 plays to the end.

    """

    topics: tuple[str, ...] = ()
    without: tuple[str, ...] = ()
    offset_s: float = 0.0
    duration_s: float = 0.0

    def takes(self, topic: str) -> bool:
        """Whether a topic is played."""
        return (not self.topics or topic in self.topics) and topic not in self.without


class BagPlayer(Node):
    """
    Publish the messages of a bag (mcap or sqlite3) as they were recorded.

    Parameters
    ----------
    path : str or Path
        The bag's folder or file.
    excerpt : Excerpt
    timeline : Timeline
        Speed and pause.
    keyboard : Keyboard
        Changes them, where there is a terminal.
    clock_hz : float
        How often the time of the bag goes out on /clock, besides with every message; 0 for never.

    Raises
    ------
    FileNotFoundError, ValueError
        When there is no such bag, or none of its messages can be published.

    """

    def __init__(self, path: str | Path, excerpt: Excerpt, timeline: Timeline,
                 keyboard: Keyboard, clock_hz: float) -> None:
        """Read the bag's list of topics and create a publisher for each."""
        super().__init__('replay')
        self._path, self._excerpt = Path(path), excerpt
        self._timeline, self._keyboard = timeline, keyboard
        self._clock_period_s = 1.0 / clock_hz if clock_hz else None
        self._clock_due = 0.0
        self._publishers_by_topic: dict[str, Publisher] = {}
        with open_bag(self._path) as reader:
            for connection in reader.connections:
                if (connection.topic != '/clock' and connection.msgcount > 0
                        and excerpt.takes(connection.topic)):
                    self._advertise(connection)
            self._check(reader)
        self._clock_publisher = (
            self.create_publisher(Clock, '/clock', 10) if clock_hz else None)

    def play(self, loops: int, wait_s: float, delay_s: float) -> int:
        """
        Publish the bag `loops` times over; return how many messages went out.

        Parameters
        ----------
        loops : int
            How often, 0 for ever.
        wait_s : float
            How long to wait for subscribers first.
        delay_s : float
            How long to wait then.

        """
        publishers = list(self._publishers_by_topic.values())
        if wait_s > 0 and not wait_for_subscribers(self, publishers, wait_s):
            self.get_logger().warning(
                f'nobody subscribes to {", ".join(sorted(self._publishers_by_topic))} after '
                f'{wait_s:g} s; publishing all the same (remap with --ros-args -r FROM:=TO)')
        if self._clock_publisher is not None:
            wait_for_subscribers(self, [self._clock_publisher], min(wait_s, _CLOCK_WAIT_S))
        if self._keyboard.is_there:
            self.get_logger().info(HELP)
        sleep_until(self, time.monotonic() + delay_s)
        count = loop = 0
        while (loops == 0 or loop < loops) and self.context.ok():
            with open_bag(self._path) as reader:
                wanted = [connection for connection in reader.connections
                          if connection.topic in self._publishers_by_topic]
                count += self._play_once(bag_messages(reader, wanted, *self._span(reader)))
            loop += 1
        wait_delivered(self, publishers)
        return count

    def _play_once(self, messages: Iterable[tuple[Connection, int, bytes]]) -> int:
        count = 0
        for connection, stamp_ns, raw in messages:
            if count == 0:
                self._timeline.begin(stamp_ns)
            if not self._wait_for(stamp_ns):
                break
            self._timeline.passed(stamp_ns)
            self._publish_clock(stamp_ns)
            self._publishers_by_topic[connection.topic].publish(bytes(raw))
            count += 1
        return count

    def _wait_for(self, stamp_ns: int) -> bool:
        """Let the bag's time run to `stamp_ns`, ticking the clock; False when ROS shuts down."""
        while True:
            self._obey_keys()
            wait_s = self._timeline.wait_s(stamp_ns)
            if wait_s <= _TICK_S:
                return sleep_until(self, time.monotonic() + wait_s) and self.context.ok()
            if not sleep_until(self, time.monotonic() + _TICK_S):
                return False
            if self._clock_period_s is not None and time.monotonic() >= self._clock_due:
                self._publish_clock(min(stamp_ns, self._timeline.position_ns))

    def _obey_keys(self) -> None:
        for key in self._keyboard.keys():
            if key == PAUSE:
                self._timeline.toggle()
                self.get_logger().info('paused' if self._timeline.is_paused else 'going on')
            elif key == NEXT:
                self._timeline.step()
            else:
                self._timeline.change_speed(key == FASTER)
                self.get_logger().info(f'rate {self._timeline.speed:.3g}')

    def _span(self, reader: Reader) -> tuple[int | None, int | None]:
        """Return the recorded times between which is played."""
        start_ns = reader.start_time + round(self._excerpt.offset_s * _NS)
        duration_s = self._excerpt.duration_s
        return start_ns, start_ns + round(duration_s * _NS) if duration_s else None

    def _check(self, reader: Reader) -> None:
        if not self._publishers_by_topic:
            there = sorted({item.topic for item in reader.connections if item.msgcount > 0})
            raise ValueError(f'bag: {self._path} has no messages that can be published here; its '
                             f'topics are {", ".join(there) or "none"}')
        length_s = (reader.end_time - reader.start_time) / _NS
        if self._excerpt.offset_s > length_s:
            raise ValueError(f'--start-offset {self._excerpt.offset_s:g}: the bag is '
                             f'{length_s:.1f} s long')

    def _publish_clock(self, stamp_ns: int) -> None:
        if self._clock_publisher is None or self._clock_period_s is None:
            return
        self._clock_due = time.monotonic() + self._clock_period_s
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

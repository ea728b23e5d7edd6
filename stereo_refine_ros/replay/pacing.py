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

"""Publishing at a pace: wait for subscribers, sleep while answering ROS, end delivered."""

from __future__ import annotations

from collections.abc import Sequence
import time

import rclpy
from rclpy._rclpy_pybind11 import RCLError
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile

# Reliable, so that reliable and best-effort subscribers both match; deep enough for a burst.
REPLAY_QOS = QoSProfile(depth=10)
_POLL_S = 0.02
_SETTLED_S = 1.0
# A subscriber that found us later than we found it asks for what it missed only after a
# heartbeat, and Fast DDS sends one every three seconds; on a loaded host some go unheard.
_DELIVERY_S = 15.0


def sleep_until(node: Node, deadline: float) -> bool:
    """Serve `node` until `time.monotonic()` is `deadline`; return False when ROS shuts down."""
    while node.context.ok():
        remaining = deadline - time.monotonic()
        if remaining <= 0:
            return True
        rclpy.spin_once(node, timeout_sec=min(remaining, 0.1))
    return False


def wait_for_subscribers(node: Node, publishers: Sequence[Publisher], timeout_s: float,
                         settled_s: float = _SETTLED_S) -> bool:
    """
    Wait until every publisher has a subscriber, or the matches stopped changing.

    Parameters
    ----------
    node : Node
        Served while waiting.
    publishers : sequence of Publisher
        All of `node`.
    timeout_s : float
        Longest wait in seconds; 0 returns at once.
    settled_s : float
        With some but not all matched, how long nothing may change before that is enough.

    Returns
    -------
    bool
        Whether anybody listens.

    """
    start = changed = time.monotonic()
    matched = -1
    while node.context.ok() and time.monotonic() - start < timeout_s:
        now = sum(publisher.get_subscription_count() > 0 for publisher in publishers)
        if now != matched:
            matched, changed = now, time.monotonic()
        if now == len(publishers) or (now and time.monotonic() - changed > settled_s):
            return True
        sleep_until(node, time.monotonic() + _POLL_S)
    return any(publisher.get_subscription_count() > 0 for publisher in publishers)


def wait_delivered(node: Node, publishers: Sequence[Publisher]) -> None:
    """Wait, not for ever, until the reliable subscribers have what was published."""
    deadline = time.monotonic() + _DELIVERY_S
    step = Duration(seconds=_POLL_S)
    for publisher in publishers:
        while node.context.ok() and time.monotonic() < deadline:
            try:
                if publisher.wait_for_all_acked(step):
                    break
            except RCLError:
                if node.context.ok():
                    raise  # else ROS was shut down meanwhile: nothing is left to wait for

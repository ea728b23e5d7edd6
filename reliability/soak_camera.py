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
The camera of `soak.py`: good pairs, and faults drawn from a seed.

Every set is written to a log once it is out, so that nothing is forgotten when the process kills
itself. Incomplete sets lack the right image, so that the left one waits in vain.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path
import signal
import time

from malformed import HARMFUL, HARMLESS, LEFT, LEFT_INFO, Messages, pick, RIGHT, RIGHT_INFO
import numpy as np
import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from rclpy.time import Time
from sensor_msgs.msg import CameraInfo, Image
from stereo_refine_ros.messages.scene import (
    camera_info_messages, image_message, nominal_geometry, scene_header)

TOPICS = (LEFT, LEFT_INFO, RIGHT_INFO, RIGHT)
SIZES = ((320, 240), (320, 240), (320, 240), (256, 192), (400, 300))
# Whole sets that have to be refused; a P of wrong length cannot be sent at all.
MALFORMED = [name for name in HARMFUL if name != 'one stamp']
ODD = ['padding', 'byte order', 'unused fields']
DEPTH = 100
# By then a set has arrived, on a busy machine too; what a killed process still held is lost.
_DELIVERY_S = 1.0


class FaultyCamera(Node):
    """Publish sets of four messages and write down what each was."""

    def __init__(self, log: Path, seed: int) -> None:
        """Create the publishers; nobody listens yet."""
        super().__init__('soak_camera')
        self._rng = np.random.default_rng(seed)
        self._log = log.open('a', encoding='utf-8', buffering=1)
        self._behind_ns = 0
        self._size = SIZES[0]
        self._publishers = {
            topic: self.create_publisher(
                Image if topic in (LEFT, RIGHT) else CameraInfo, topic, QoSProfile(depth=DEPTH))
            for topic in TOPICS}

    def wait_for_node(self) -> None:
        """Wait until every topic has its subscriber, and until that is known on both sides."""
        while not all(item.get_subscription_count() for item in self._publishers.values()):
            rclpy.spin_once(self, timeout_sec=0.1)
        time.sleep(3.0)  # a writer knows its reader before the reader knows it

    def step(self, fault_rate: float) -> None:
        """Publish one set, good or not."""
        faults = (self._malformed, self._odd, self._incomplete, self._pause, self._jump_back,
                  self._change_size, self._die)
        weights = np.array([8, 4, 4, 1, 1, 1, 0.5])
        if self._rng.random() >= fault_rate:
            self._publish('good', self._set())
        else:
            faults[int(self._rng.choice(len(faults), p=weights / weights.sum()))]()

    def _set(self) -> Messages:
        width, height = self._size
        stamp_ns = self.get_clock().now().nanoseconds - self._behind_ns
        stamp = Time(nanoseconds=stamp_ns).to_msg()
        shift = int(self._rng.integers(2, 16))
        wide = self._rng.integers(0, 256, (height, width + shift, 3), np.uint8)
        infos = camera_info_messages(
            nominal_geometry(height, width), height, width, scene_header(stamp))
        infos[1].header = scene_header(stamp)
        return {LEFT: image_message(wide[:, :width], 'bgr8', scene_header(stamp)),
                RIGHT: image_message(wide[:, shift:], 'bgr8', scene_header(stamp)),
                LEFT_INFO: infos[0], RIGHT_INFO: infos[1]}

    def _publish(self, kind: str, messages: Messages) -> None:
        for topic in TOPICS:
            if topic in messages:
                self._publishers[topic].publish(messages[topic])
        self._log.write(kind + '\n')

    def _malformed(self) -> None:
        messages = self._set()
        name = pick(self._rng, MALFORMED)
        HARMFUL[name](messages, self._rng)
        self._publish(f'malformed: {name}', messages)

    def _odd(self) -> None:
        messages = self._set()
        HARMLESS[pick(self._rng, ODD)](messages, self._rng)
        self._publish('good', messages)

    def _incomplete(self) -> None:
        messages = self._set()
        del messages[RIGHT]
        self._publish('incomplete', messages)

    def _pause(self) -> None:
        self._log.write('pause\n')
        time.sleep(self._rng.uniform(0.5, 3.0))

    def _jump_back(self) -> None:
        self._log.write('clock jumps back\n')
        self._behind_ns += int(self._rng.uniform(1e9, 60e9))

    def _change_size(self) -> None:
        self._log.write('size changes\n')
        self._size = pick(self._rng, SIZES)

    def _die(self) -> None:
        """Be killed in the middle of a set, once the sets before it are delivered."""
        time.sleep(_DELIVERY_S)
        messages = self._set()
        del messages[RIGHT]
        self._publish('incomplete', messages)
        self._log.write('killed\n')
        time.sleep(_DELIVERY_S)
        os.kill(os.getpid(), signal.SIGKILL)


def main() -> None:
    """Publish until interrupted."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--log', type=Path, required=True)
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--rate', type=float, default=15.0)
    parser.add_argument('--fault-rate', type=float, default=0.1)
    options, ros_args = parser.parse_known_args()
    parent = os.getppid()
    # Its own handler: a SIGTERM ends the process between two sets.
    rclpy.init(args=ros_args, signal_handler_options=SignalHandlerOptions.NO)
    stop: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, _: stop.append(number))
    camera = FaultyCamera(options.log, options.seed)
    camera.wait_for_node()
    while not stop and os.getppid() == parent:
        camera.step(options.fault_rate)
        time.sleep(1.0 / options.rate)
    camera.step(0.0)  # so that no incomplete set is the last
    time.sleep(0.5)
    rclpy.try_shutdown()


if __name__ == '__main__':
    main()

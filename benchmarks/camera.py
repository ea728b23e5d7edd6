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

"""A stereo camera for the live benchmark: one scene, published at a rate until told to stop."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
import time

from cases import load_case
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import CameraInfo, Image
from stereo_refine_ros.messages.scene import (
    camera_info_messages, image_message, nominal_geometry, scene_header)

RELIABLE = QoSProfile(depth=10)


class Camera(Node):
    """Publish the same pair again and again; only the stamps differ."""

    def __init__(self, options: argparse.Namespace) -> None:
        """Make the messages once."""
        super().__init__('benchmark_camera')
        width, height, disparities = map(int, options.size.split('x'))
        case = load_case(options.scene, width, height, disparities)
        header = scene_header(self.get_clock().now().to_msg())
        infos = camera_info_messages(nominal_geometry(height, width), height, width, header)
        self._messages = [
            (self.create_publisher(type(message), topic, RELIABLE), message)
            for topic, message in (
                ('left/camera_info', infos[0]), ('right/camera_info', infos[1]),
                ('left/image_rect', image_message(case.left, options.encoding, header)),
                ('right/image_rect', image_message(case.right, options.encoding, header)))]

    def publish(self) -> int:
        """Publish one pair, stamped now; return the stamp in nanoseconds."""
        stamp = self.get_clock().now().to_msg()
        for publisher, message in self._messages:
            assert isinstance(message, (CameraInfo, Image))
            message.header.stamp = stamp
            publisher.publish(message)
        return stamp.sec * 1_000_000_000 + stamp.nanosec


def main() -> None:
    """Publish until interrupted, or until the process that started this one is gone."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--rate', type=float, default=30.0, help='pairs a second')
    parser.add_argument('--scene', default='Adirondack')
    parser.add_argument('--size', default='640x480x64', help='width x height x disparities')
    parser.add_argument('--encoding', default='bgr8', choices=('bgr8', 'mono8'))
    parser.add_argument('--stamps', type=Path, help='write the stamp of each pair, in ns, here')
    options, ros_args = parser.parse_known_args()
    parent = os.getppid()
    rclpy.init(args=ros_args)
    try:
        camera = Camera(options)
        due = time.monotonic()
        while rclpy.ok() and os.getppid() == parent:
            stamp_ns = camera.publish()
            if options.stamps:
                with options.stamps.open('a', encoding='utf-8') as stream:
                    stream.write(f'{stamp_ns}\n')
            due = max(due + 1.0 / options.rate, time.monotonic())
            time.sleep(max(0.0, due - time.monotonic()))
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()

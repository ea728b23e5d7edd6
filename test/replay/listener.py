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

"""A subscriber in the test's own process that keeps all that comes."""

from contextlib import contextmanager
import subprocess
import sys
import time

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import CameraInfo, Image
from stereo_msgs.msg import DisparityImage

KIND_OF = {
    'left/image_rect': Image, 'right/image_rect': Image, 'left/camera_info': CameraInfo,
    'right/camera_info': CameraInfo, 'ground_truth/disparity': DisparityImage}
RELIABLE = QoSProfile(depth=100)
BEST_EFFORT = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)


class Listener:
    """Messages by topic, in order of arrival."""

    def __init__(self, kind_of=None, qos=RELIABLE, namespace='', raw=False,
                 use_sim_time=False):
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node(
            'listener', context=self.context, namespace=namespace,
            parameter_overrides=[Parameter('use_sim_time', value=use_sim_time)])
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        kind_of = KIND_OF if kind_of is None else kind_of
        self.received = {topic: [] for topic in kind_of}
        for topic, kind in kind_of.items():
            self.node.create_subscription(kind, topic, self.received[topic].append, qos, raw=raw)

    def wait(self, is_done, timeout_s=30.0):
        end = time.monotonic() + timeout_s
        while not is_done() and time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.05)
        counts = {topic: len(messages) for topic, messages in self.received.items()}
        assert is_done(), f'after {timeout_s} s came {counts}'

    def close(self):
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)


@contextmanager
def replaying(*options):
    """Run `replay` in a process of its own; give its Popen."""
    process = subprocess.Popen(
        [sys.executable, '-m', 'stereo_refine_ros.replay', *map(str, options)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        if process.poll() is None:
            process.terminate()
        process.communicate(timeout=20)


def stamp_ns(message):
    return message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec


def pixels(message, dtype=np.uint8):
    values = np.frombuffer(message.data, np.uint8)
    rows = values.reshape(message.height, message.step).view(dtype)
    return rows if message.encoding in ('mono8', '32FC1') else rows.reshape(
        message.height, message.width, -1)

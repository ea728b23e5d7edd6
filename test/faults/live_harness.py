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

"""A node in this process, spun in a thread, and a client of it in a context of its own."""

import threading

from diagnostic_msgs.msg import DiagnosticArray
from harness import Client, reliable_inputs, stereo_messages, textured_pair
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from stereo_msgs.msg import DisparityImage

from stereo_refine_ros.node.refine_node import RefineNode

PAIR = textured_pair()
PARAMS = {'matching.num_disparities': 16}


class Harness:
    """The node, spun in a thread, and a client in a context of its own."""

    def __init__(self):
        rclpy.init(args=['--ros-args', *reliable_inputs()])
        self.node = RefineNode(parameter_overrides=[
            Parameter(name, value=value) for name, value in PARAMS.items()])
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.thread = threading.Thread(target=self.executor.spin)
        self.thread.start()
        self.client = Client()
        for topic, kind in (('disparity', DisparityImage), ('metrics', DiagnosticArray),
                            ('/diagnostics', DiagnosticArray)):
            self.client.subscribe(topic, kind)
        self.client.connect(stereo_messages(*PAIR, 1))
        self.stamp = 10 ** 9

    def close(self):
        self.client.close()
        self.executor.shutdown()
        self.thread.join()
        self.node.stop(5.0)
        self.node.destroy_node()
        rclpy.try_shutdown()

    def pair(self):
        self.stamp += 33_000_000
        return stereo_messages(*PAIR, self.stamp)

    def until_failed(self, frames):
        counts = self.node._counters.counts
        self.client.until(lambda: counts().refused.get('processing') == frames, 5.0,
                          lambda: f'{frames} failed frames in {counts()}')

    def until_diagnosed(self, text, level):
        found = self.client.received['/diagnostics']
        self.client.until(lambda: any(
            text in message.status[0].message and message.status[0].level == level
            for message in found), 5.0, lambda: f'{text!r} in {found[-1:]}')

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

"""What the demo's node keeps of the messages: advice, whole frames, and nothing of old scenes."""

import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import numpy as np
import pytest
import rclpy
from sensor_msgs.msg import Image
from stereo_msgs.msg import DisparityImage

from demo.collector import Collector  # noqa: I100
from stereo_refine_ros.messages.disparity import disparity_message
from stereo_refine_ros.messages.metrics import metrics_message
from stereo_refine_ros.messages.outputs import image_message
from stereo_refine_ros.types import DisparityMap, StereoGeometry
from std_msgs.msg import Header  # noqa: I100

pytestmark = pytest.mark.ros
WARN, ERROR, OK = DiagnosticStatus.WARN, DiagnosticStatus.ERROR, DiagnosticStatus.OK
KINDS = {'disparity': DisparityImage, 'disparity/preliminary': DisparityImage,
         'segments': Image, 'confidence': Image, 'metrics': DiagnosticArray,
         '/diagnostics': DiagnosticArray}


class Desk:
    """A collector and a node that publishes what the refining one would."""

    def __init__(self):
        rclpy.init(args=[])
        self.collector = Collector()
        self.node = rclpy.create_node('desk')
        self.publishers = {topic: self.node.create_publisher(kind, topic, 10)
                           for topic, kind in KINDS.items()}
        self.until(lambda: all(publisher.get_subscription_count()
                               for publisher in self.publishers.values()))

    def header(self):
        return Header(stamp=self.node.get_clock().now().to_msg(), frame_id='camera')

    def say(self, topic, name, level, text, header=None, **figures):
        self.publishers[topic].publish(metrics_message(
            header or self.header(), name, 'camera', figures, level, text))

    def until(self, condition):
        end = time.monotonic() + 20.0
        while not condition():
            assert time.monotonic() < end
            self.collector.spin_for(0.1)

    def close(self):
        self.collector.destroy_node()
        self.node.destroy_node()
        rclpy.try_shutdown()


@pytest.fixture
def desk():
    desk = Desk()
    yield desk
    desk.close()


def test_advice_is_that_of_the_last_frame_or_of_the_last_second(desk):
    collector = desk.collector
    desk.say('metrics', 'n', OK, 'refined', row_offset_px=0.25)
    desk.until(lambda: collector.history == [{'row_offset_px': 0.25}])
    assert collector.advice == ''
    desk.say('metrics', 'n', WARN, 'one lens is dirty: clean both', row_offset_px=0.5)
    desk.until(lambda: len(collector.history) == 2)
    assert collector.advice == 'WARN: one lens is dirty: clean both'
    desk.say('/diagnostics', 'motor', ERROR, 'too hot')
    desk.say('/diagnostics', '/n: stereo refinement', ERROR, 'swapped: swap the topics')
    desk.until(lambda: collector.advice == 'ERROR: swapped: swap the topics')


def test_a_new_scene_begins_without_the_old_one(desk):
    collector, old = desk.collector, desk.header()
    desk.say('metrics', 'n', WARN, 'noisy', old, fps=1)
    desk.until(lambda: collector.history)
    collector.begin(with_truth=False)
    assert (collector.history, collector.advice, collector.frame) == ([], '', None)
    desk.say('metrics', 'n', WARN, 'noisy', old, fps=2)
    desk.say('metrics', 'n', OK, 'refined', fps=3)
    desk.until(lambda: collector.history)
    assert collector.history == [{'fps': 3.0}] and collector.advice == ''


def test_a_frame_is_whole_with_its_confidence(desk):
    shape, header = (6, 8), desk.header()
    values = np.full(shape, 5, np.float32)
    confidence = np.linspace(0, 1, 48, dtype=np.float32).reshape(shape)
    geometry = StereoGeometry(100.0, 0.1, 3.5, 2.5, 3.5)
    for topic in ('disparity', 'disparity/preliminary'):
        desk.publishers[topic].publish(
            disparity_message(DisparityMap(values, 0, 16), geometry, header))
    desk.publishers['segments'].publish(
        image_message(header, np.ones(shape, np.int32), '32SC1'))
    desk.say('metrics', 'n', OK, 'refined', header, confidence_mean=0.5)
    desk.until(lambda: desk.collector.history)
    assert not desk.collector.has_frame
    desk.publishers['confidence'].publish(image_message(header, confidence, '32FC1'))
    desk.until(lambda: desk.collector.has_frame)
    frame = desk.collector.frame
    np.testing.assert_array_equal(frame.confidence, confidence)
    np.testing.assert_array_equal(frame.refined, values)
    np.testing.assert_array_equal(frame.labels, np.ones(shape, np.int32))
    assert frame.metrics == {'confidence_mean': 0.5}

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

"""What was published is delivered before `replay` ends, to slow subscribers too."""

import signal
import subprocess
import sys
import threading
import time

from printed import own_lines
import pytest
import rclpy
from std_msgs.msg import String

from stereo_refine_ros.replay.pacing import REPLAY_QOS, wait_delivered

pytestmark = pytest.mark.ros
# More than one of the three seconds between two heartbeats of Fast DDS, and than two.
SLOW_S = 7.0
SUBSCRIBER = """
import rclpy
from std_msgs.msg import String
rclpy.init()
node = rclpy.create_node('slow')
subscription = node.create_subscription(String, 'words', lambda word: print(word.data), 10)
rclpy.spin_once(node)
"""


@pytest.fixture
def publisher():
    context = rclpy.Context()
    rclpy.init(context=context)
    node = rclpy.create_node('speaker', context=context)
    yield node, node.create_publisher(String, 'words', REPLAY_QOS)
    node.destroy_node()
    rclpy.try_shutdown(context=context)


@pytest.fixture
def subscriber(publisher):
    process = subprocess.Popen(
        [sys.executable, '-c', SUBSCRIBER], stdout=subprocess.PIPE, text=True)
    end = time.monotonic() + 60.0
    while publisher[1].get_subscription_count() == 0:
        assert time.monotonic() < end, 'no subscriber'
        time.sleep(0.02)
    process.send_signal(signal.SIGSTOP)
    yield process
    process.send_signal(signal.SIGCONT)
    process.kill()
    process.communicate()


def _delivery_s(node, words, after_s, event):
    """Publish, let `event` happen later, and return how long the delivery took."""
    words.publish(String(data='whole'))
    timer = threading.Timer(after_s, event)
    timer.start()
    start = time.monotonic()
    wait_delivered(node, [words])
    took_s = time.monotonic() - start
    timer.join()
    return took_s


def test_subscriber_that_stalls_is_waited_for(publisher, subscriber):
    took_s = _delivery_s(*publisher, SLOW_S, lambda: subscriber.send_signal(signal.SIGCONT))
    assert took_s > SLOW_S - 0.5
    assert own_lines(subscriber.communicate(timeout=20)[0]) == 'whole\n'


def test_shutdown_ends_the_wait(publisher, subscriber):
    node, words = publisher
    assert _delivery_s(node, words, 0.5, node.context.try_shutdown) < 3.0
    assert subscriber.poll() is None


def test_nobody_is_waited_for_without_subscribers(publisher):
    assert _delivery_s(*publisher, 0.0, lambda: None) < 0.5

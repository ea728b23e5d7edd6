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

"""What goes wrong around a robot, done to the real node in its own process over DDS."""

import itertools
import os
import signal
import subprocess
import sys

from diagnostic_msgs.msg import DiagnosticArray
from harness import (
    Client, floats, parameter_messages, reliable_inputs, running_node, stereo_messages,
    textured_pair)
import numpy as np
from printed import own_lines
import pytest
from rcl_interfaces.srv import SetParametersAtomically
from stereo_msgs.msg import DisparityImage

from stereo_refine_ros.params import load_preset, SPECS

pytestmark = pytest.mark.ros
PAIR = textured_pair()
LEFT, RIGHT = 'left/image_rect', 'right/image_rect'
INFOS = ('left/camera_info', 'right/camera_info')
_stamps = itertools.count(1_000_000_007, 33_000_000)


@pytest.fixture(scope='module')
def node():
    with running_node('-p', 'matching.num_disparities:=16', *reliable_inputs()) as process:
        yield process


@pytest.fixture
def client(node):
    client = Client()
    client.subscribe('disparity', DisparityImage)
    client.subscribe('/diagnostics', DiagnosticArray)
    client.connect(good_pair())
    yield client
    client.close()


def good_pair(**values):
    return stereo_messages(*PAIR, next(_stamps), **values)


def assert_good_pair_comes_out(client):
    message, = client.exchange_until(good_pair, ('disparity',), lambda answers: True)
    assert np.median(floats(message.image)) == pytest.approx(6.0, abs=0.2)


def assert_good_pairs_come_out(client, pairs):
    """Send pairs until so many are answered; a busy middleware may lose one in ten."""
    answered = 0
    for _ in range(pairs + pairs // 10):
        try:
            client.exchange(good_pair(), timeout_s=5.0)
        except AssertionError:
            continue
        answered += 1
        if answered == pairs:
            return
    raise AssertionError(f'{answered} of {pairs} pairs came out')


def until_health(client, condition, what):
    """Wait for a /diagnostics message newer than now that satisfies a condition."""
    client.received['/diagnostics'].clear()
    client.until(lambda: any(condition(message.status[0])
                             for message in client.received['/diagnostics']), 10.0, what)


def replay(*options):
    return subprocess.Popen(
        [sys.executable, '-m', 'stereo_refine_ros.replay', '--synthetic', '--rate', '20',
         '--loop', *options], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def test_a_publisher_killed_and_restarted_mid_frame(node, client):
    for _ in range(2):
        camera = replay()
        try:
            client.received['disparity'].clear()
            client.until(lambda: len(client.received['disparity']) >= 3, 30.0, 'replayed frames')
        finally:
            camera.send_signal(signal.SIGKILL)
            camera.wait()
    assert node.process.poll() is None
    assert_good_pair_comes_out(client)


def test_camera_info_that_comes_late_or_not_at_all_holds_nothing_up(client):
    assert_good_pair_comes_out(client)
    late = []
    for _ in range(12):
        sent = good_pair(focal=321.0)
        late.append({topic: sent.pop(topic) for topic in INFOS})
        message, = client.exchange(sent)
        assert message.header == sent[LEFT].header
        assert message.f == 200.0  # the newest that came
    client.send(late[-1])
    client.until(lambda: client.exchange({
        topic: message for topic, message in good_pair().items() if topic not in INFOS}
    )[0].f == 321.0, 10.0, 'the late calibration')
    assert_good_pair_comes_out(client)


def test_calibration_changed_while_running(client):
    for focal, baseline in ((200.0, 0.1), (321.0, 0.25), (200.0, 0.1)):
        message, = client.exchange(good_pair(focal=focal, baseline=baseline))
        assert (message.f, message.t) == (focal, pytest.approx(baseline))


def test_size_changed_while_running(client):
    for width, height in ((96, 64), (160, 96), (200, 120), (160, 96)):
        sent = stereo_messages(*textured_pair(width, height), next(_stamps))
        message, = client.exchange(sent)
        assert (message.image.width, message.image.height) == (width, height)


def test_size_changed_with_the_old_calibration_is_refused(client):
    sent = stereo_messages(*textured_pair(96, 64), next(_stamps))
    old = good_pair()
    for topic in INFOS:
        old[topic].header.stamp = sent[LEFT].header.stamp
        sent[topic] = old[topic]
    client.received['disparity'].clear()
    client.send(sent)
    until_health(client, lambda status: 'refused 1 pairs (camera_info_size)' in status.message,
                 'a refusal')
    assert client.received['disparity'] == []
    assert_good_pair_comes_out(client)


def test_a_right_camera_that_stops_is_named_and_comes_back(client):
    assert_good_pair_comes_out(client)
    client.received['/diagnostics'].clear()

    def complains():
        sent = good_pair()
        client.send({topic: sent[topic] for topic in (LEFT, *INFOS)})
        return any(message.status[0].level == b'\x02' and RIGHT in message.status[0].message
                   for message in client.received['/diagnostics'])
    client.until(complains, 10.0, 'an ERROR that names the right image')
    assert_good_pair_comes_out(client)
    until_health(client, lambda status: status.level != b'\x02', 'the end of the ERROR')


def test_rates_that_differ(client):
    until_health(client, lambda status: True, 'counters')
    before = client.health()
    for i in range(30):
        sent = good_pair()
        if i % 3:
            del sent[RIGHT]
            client.send(sent)
        else:
            client.exchange(sent)
    client.until(lambda: client.health()['pairs_published'] == before['pairs_published'] + 10,
                 10.0, 'the counters')
    # The last two wait in the queues for a partner that may still come.
    assert client.health()['pairs_unmatched'] - before['pairs_unmatched'] == 18


def test_a_looped_bag_and_a_clock_that_jumps_back(client):
    first = [stereo_messages(*PAIR, 5_000_000_000 + i * 33_000_000) for i in range(4)]
    for sent in first * 3:
        client.exchange(sent)
    client.exchange(stereo_messages(*PAIR, 0))
    assert_good_pair_comes_out(client)


NEVER_READS = """
import rclpy, time
from rclpy.qos import QoSProfile
from stereo_msgs.msg import DisparityImage
rclpy.init()
node = rclpy.create_node('never_reads')
node.create_subscription(DisparityImage, 'disparity', print, QoSProfile(depth=1))
print('listening', flush=True)
time.sleep(1000)
"""


def test_a_subscriber_that_never_reads(node, client):
    reader = subprocess.Popen(
        [sys.executable, '-c', NEVER_READS], stdout=subprocess.PIPE, text=True)
    try:
        assert next(filter(own_lines, reader.stdout)) == 'listening\n'
        client.until(lambda: client.node.count_subscribers('disparity') == 2, 30.0, 'a reader')
        assert_good_pairs_come_out(client, 20)
        os.kill(reader.pid, signal.SIGSTOP)  # now its middleware does not answer either
        assert_good_pairs_come_out(client, 20)
    finally:
        reader.kill()
        reader.wait()
        reader.stdout.close()
    assert_good_pair_comes_out(client)


STORMY = [spec for spec in SPECS if not spec.name.startswith('sync')
          and spec.name not in ('preset', 'matching.method')]


def random_values(rng):
    """Draw a few parameters; about one set in three has a value that must be refused."""
    chosen, is_good = {}, True
    for spec in rng.choice(STORMY, rng.integers(1, 6), replace=False):
        wrong = rng.random() < 0.15
        is_good &= not wrong
        if wrong:
            value = ('nonsense', 1e9, -1e9, float('nan'))[rng.integers(4)]
            value = value if spec.type is not str else 'nonsense'
        elif spec.choices:
            value = str(rng.choice(spec.choices))
        elif spec.type is bool:
            value = bool(rng.integers(2))
        else:
            # Within the range, but near the default: a storm, not a benchmark of huge windows.
            value = spec.type(min(max(spec.default * rng.uniform(0.5, 1.5), spec.low), spec.high))
        chosen[spec.name.replace('.', '__')] = value
    return chosen, is_good


def test_a_thousand_random_parameter_sets(node, client):
    rng = np.random.default_rng(11)
    service = client.node.create_client(
        SetParametersAtomically, '/refine_node/set_parameters_atomically')
    assert service.wait_for_service(10.0)
    names = [spec.name for spec in SPECS]
    known = dict(zip(names, client.get(*names), strict=True))
    accepted = 0
    client.received['disparity'].clear()
    for i in range(1000):
        values, is_good = random_values(rng)
        if i % 20 == 0:
            client.send(good_pair())
        future = service.call_async(
            SetParametersAtomically.Request(parameters=parameter_messages(values)))
        client.until(future.done, 20.0, 'an answer')
        result = future.result().result
        assert result.successful == is_good, (values, result.reason)
        if is_good:
            accepted += 1
            known.update({name.replace('__', '.'): value for name, value in values.items()})
        else:
            assert result.reason
    # Refused sets left nothing behind, accepted ones everything.
    assert client.get(*names) == list(known.values())
    assert 500 < accepted < 900
    client.until(lambda: client.received['disparity'], 120.0, 'frames in the storm')
    assert client.set_atomically(preset='accurate').successful
    back = load_preset('live', {'matching.num_disparities': 16}).as_dict()
    assert client.set_atomically(**{
        name.replace('.', '__'): value for name, value in back.items()}).successful
    assert_good_pair_comes_out(client)
    assert node.process.poll() is None


def test_every_pair_is_still_accounted_for(client):
    """After all of the above, in the same process."""
    until_health(client, lambda status: True, 'counters')
    client.until(lambda: client.health()['pairs_in_flight'] == 0, 10.0, 'quiet')
    health = client.health()
    assert health['pairs_received'] == (
        health['pairs_published'] + health['pairs_superseded'] + health['pairs_refused'])
    assert health['processing_failures'] == 0

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

"""The node as robots start it: names, files, QoS, other people's disparity, signals."""

import itertools
import random
import signal
import time

from diagnostic_msgs.msg import DiagnosticArray
from harness import (
    Client, floats, NodeProcess, reliable_inputs, running_node, stereo_messages, textured_pair)
import numpy as np
import pytest
from rclpy.qos import ReliabilityPolicy
from stereo_msgs.msg import DisparityImage

from stereo_refine_ros.messages.images import fill_image
from stereo_refine_ros.node.views import sure_part
from stereo_refine_ros.params import load_preset
from stereo_refine_ros.pipeline import StereoRefiner

pytestmark = pytest.mark.ros
_stamps = itertools.count(1_000_000_007, 33_000_000)
PAIR = textured_pair()


@pytest.fixture
def make_client():
    clients = []

    def make(*args):
        clients.append(Client(*args))
        return clients[-1]
    yield make
    for client in clients:
        client.close()


def test_namespace_remapping_file_and_qos_overrides(make_client, tmp_path):
    path = tmp_path / 'robot.yaml'
    path.write_text('/robot/refine_node:\n  ros__parameters:\n    preset: accurate\n'
                    '    matching:\n      num_disparities: 24\n      method: sgbm\n'
                    '    segmentation.k: 250\n', encoding='utf-8')
    override = 'qos_overrides./robot/camera/left.subscription.reliability'
    with running_node(
            '-r', '__ns:=/robot', '-r', 'left/image_rect:=camera/left', '-r',
            'disparity:=refined', '--params-file', str(path),
            '-p', f'{override}:=reliable') as node:
        client = make_client('/robot')
        client.subscribe('refined', DisparityImage)
        sent = stereo_messages(*PAIR, next(_stamps))
        sent['camera/left'] = sent.pop('left/image_rect')
        client.publisher('camera/left', type(sent['camera/left']))
        client.connect(sent)
        info, = client.node.get_subscriptions_info_by_topic('/robot/camera/left')
        assert info.qos_profile.reliability == ReliabilityPolicy.RELIABLE
        info, = client.node.get_subscriptions_info_by_topic('/robot/right/image_rect')
        assert info.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
        client.send(sent)
        client.until(lambda: client.received['refined'], 60.0, lambda: f'a frame\n{node.log}')
        assert client.received['refined'][0].max_disparity == 23.0
        expected = load_preset('accurate', {
            'matching.num_disparities': 24, 'matching.method': 'sgbm', 'segmentation.k': 250})
        values = expected.as_dict()
        assert client.get(*values) == list(values.values())


def test_subscribes_only_while_somebody_listens(make_client):
    with running_node():
        client = make_client()
        left = client.publisher('left/image_rect')
        client.subscribe('/diagnostics', DiagnosticArray)
        client.until(lambda: any('idle: nobody subscribes' in message.status[0].message
                                 for message in client.received['/diagnostics']), 10.0, 'idle')
        assert left.get_subscription_count() == 0
        client.subscribe('depth', type(stereo_messages(*PAIR, 1)['left/image_rect']))
        client.until(lambda: left.get_subscription_count() == 1, 5.0, 'a subscription')
        assert client.node.count_subscribers('ground_truth/disparity') == 0
        client.node.destroy_subscription(next(
            item for item in client.node.subscriptions if item.topic_name == '/depth'))
        client.until(lambda: left.get_subscription_count() == 0, 5.0, 'no subscription')


def test_an_incompatible_publisher_and_a_silent_remapped_topic_are_named(make_client):
    with running_node(*reliable_inputs(), '-r', 'right/image_rect:=cam/right') as node:
        client = make_client()
        client.subscribe('disparity', DisparityImage)
        client.publisher('left/image_rect', reliability=ReliabilityPolicy.BEST_EFFORT)
        for text in ('left/image_rect: a publisher offers an incompatible QoS',
                     'right/image_rect (/cam/right), left/camera_info'):
            client.until(lambda text=text: text in node.log, 20.0, text)


def test_without_any_camera_info_the_disparity_comes_and_says_what_it_lacks(make_client):
    with running_node(*reliable_inputs(), '-p', 'matching.num_disparities:=16') as node:
        client = make_client()
        client.subscribe('disparity', DisparityImage)
        client.subscribe('/diagnostics', DiagnosticArray)
        images = ('left/image_rect', 'right/image_rect')
        client.connect(images)

        def said():
            sent = stereo_messages(*PAIR, next(_stamps))
            client.send({topic: sent[topic] for topic in images})
            return any('disparity comes without depth: no left/camera_info came' in
                       message.status[0].message for message in client.received['/diagnostics'])
        client.until(said, 30.0, lambda: f'a word on camera_info\n{node.log}')
        assert client.received['disparity'][-1].f == 0.0
        assert 'camera.baseline and camera.focal_length' in node.log


def external_messages(values, stamp, **fields):
    """Give a pair whose disparity comes from somebody else."""
    sent = stereo_messages(*PAIR, stamp)
    message = DisparityImage(f=200.0, t=0.1, min_disparity=0.0, max_disparity=31.0)
    for name, value in fields.items():
        setattr(message, name, value)
    message.header = sent['left/image_rect'].header
    fill_image(message.image, np.asarray(values, np.float32), '32FC1')
    return {**sent, 'preliminary/disparity': message}


def test_sgbm_from_outside_is_refined_to_the_bits_of_sgbm_inside(make_client):
    params = load_preset('live', {'matching.num_disparities': 32, 'matching.method': 'sgbm'})
    expected = StereoRefiner(params).process(*PAIR)
    preliminary = expected.preliminary.values
    with running_node('-p', 'matching.method:=external', *reliable_inputs()) as node:
        client = make_client()
        client.subscribe('disparity', DisparityImage)
        client.subscribe('metrics', DiagnosticArray)
        sent = external_messages(np.nan_to_num(preliminary, nan=-1.0), next(_stamps))
        client.connect(sent)
        message, metrics = client.exchange(sent, ('disparity', 'metrics'), 60.0)
        given = StereoRefiner(params).process(*PAIR, preliminary=preliminary)
        refined = sure_part(given, 0.5).values
        np.testing.assert_array_equal(floats(message.image), np.nan_to_num(refined, nan=-1.0))
        assert (message.f, message.min_disparity, message.max_disparity) == (200.0, 0.0, 31.0)
        assert message.header == sent['preliminary/disparity'].header
        values = {item.key: float(item.value) for item in metrics.status[0].values}
        assert values['photometric_psnr_refined'] > 20

        small = np.where(np.isfinite(preliminary), preliminary / 2, 0)[::2, ::2]
        half = external_messages(small, next(_stamps), t=-0.1, max_disparity=15.5)
        message, = client.exchange(half)
        assert (message.image.width, message.f) == (160, 200.0)
        assert np.median(floats(message.image)) == pytest.approx(6.0, abs=0.3)
        node.wait_log('rescaled')


def test_a_matcher_that_is_half_a_second_late_finds_its_images(make_client):
    """Twenty pairs, twice what sync.queue_size keeps, before the first map."""
    with running_node('-p', 'matching.method:=external', *reliable_inputs()):
        client = make_client()
        client.subscribe('disparity', DisparityImage)
        sent = [external_messages(np.full((96, 160), 6.25), next(_stamps)) for _ in range(20)]
        client.connect(sent[0])
        for messages in sent:
            client.send({topic: item for topic, item in messages.items() if 'image' in topic})
            client.spin(0.01)
        client.send({'preliminary/disparity': sent[0]['preliminary/disparity']})
        client.until(lambda: client.received['disparity'], 60.0, 'the refined map')
        message = client.received['disparity'][0]
        assert message.header == sent[0]['preliminary/disparity'].header
        assert np.median(floats(message.image)) == pytest.approx(6.25, abs=0.1)


def test_external_disparity_with_the_left_image_alone(make_client):
    values = np.full((96, 160), 6.25, np.float32)
    with running_node('-p', 'matching.method:=external', *reliable_inputs()):
        client = make_client()
        client.subscribe('disparity', DisparityImage)
        sent = external_messages(values, next(_stamps), f=321.0, t=-0.25)
        sent = {topic: sent[topic] for topic in ('left/image_rect', 'preliminary/disparity')}
        client.connect(sent)
        message, = client.exchange(sent, timeout_s=60.0)
        assert (message.f, message.t) == (321.0, 0.25)
        assert np.median(floats(message.image)) == pytest.approx(6.25, abs=0.1)


@pytest.mark.parametrize('arguments,reason', [
    (('-p', 'filter.radius:=0'), 'filter.radius'),
    (('-p', 'matching.method:=magic'), 'magic'),
    (('-p', 'preset:=fast'), 'fast'), (('-p', 'filter.eps:=true'), 'filter.eps')])
def test_bad_parameters_at_start_end_the_node_with_the_reason(arguments, reason):
    node = NodeProcess(*arguments)
    assert node.process.wait(60) == 1
    assert reason in node.log and 'Traceback' not in node.log


def test_an_integer_for_a_float_is_taken_at_start(make_client):
    with running_node('-p', 'filter.eps:=1', '-p', 'sync.slop:=0', ready=False) as node:
        node.wait_log('compiling', 60.0)
        client = make_client()
        assert client.get('filter.eps', 'sync.slop') == [1.0, 0.0]


def test_silent_mistakes_at_start_are_said(tmp_path):
    path = tmp_path / 'robot.yaml'
    path.write_text('stereo_node:\n  ros__parameters:\n    filter.radius: 3\n', encoding='utf-8')
    with running_node('-p', 'planes.projection:=off', '-p', 'approximate_sync:=true',
                      '-p', 'filter.radios:=3', '--params-file', str(path), ready=False) as node:
        node.wait_log('compiling', 60.0)
        for text in ("'approximate_sync' is not known and does nothing: use sync.approximate",
                     "'filter.radios' is not known and does nothing: did you mean filter.radius",
                     'robot.yaml: parameters are for /stereo_node, this node is /refine_node'):
            assert text in node.log, node.log


def test_what_the_command_line_set_stays_with_another_preset(make_client):
    with running_node('-p', 'filter.radius:=2', '-p', 'planes.projection:=off',
                      ready=False) as node:
        node.wait_log('compiling', 60.0)
        client = make_client()
        assert client.get('planes.projection') == ['off']
        assert client.set(preset='paper')[0].successful
        expected = load_preset('paper', {'filter.radius': 2, 'planes.projection': 'off'})
        values = expected.as_dict()
        assert client.get(*values) == list(values.values())


def test_fatal_lines_carry_the_name_of_the_node():
    node = NodeProcess('-r', '__node:=stereo', '-r', '__ns:=/robot', '-p', 'filter.radius:=0')
    assert node.process.wait(60) == 1
    assert '[robot.stereo]: filter.radius' in node.log and 'Traceback' not in node.log


def assert_clean(node, began):
    assert time.monotonic() - began < 2.0, f'took {time.monotonic() - began:.2f} s\n{node.log}'
    assert 'Traceback' not in node.log, node.log


@pytest.mark.parametrize('signals', [
    (signal.SIGINT,), (signal.SIGTERM,), (signal.SIGINT, signal.SIGINT),
    (signal.SIGINT, signal.SIGTERM, signal.SIGINT)])
def test_signals_while_running(signals):
    node = NodeProcess()
    node.wait_ready()
    began = time.monotonic()
    assert node.stop(*signals) == 0
    assert_clean(node, began)


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_signals_during_the_start(number):
    """From the moment the node's own code runs: before that, Python itself answers."""
    rng = random.Random(number)
    for _ in range(4):
        node = NodeProcess()
        status = f'/proc/{node.process.pid}/status'
        end = time.monotonic() + 10.0
        while not blocks(status, number) and time.monotonic() < end:
            time.sleep(0.002)
        time.sleep(rng.uniform(0.0, 1.0))
        began = time.monotonic()
        assert node.stop(number) == 0, node.log
        assert_clean(node, began)


def blocks(status, number):
    """Whether a process has blocked a signal, which is the first thing the node does."""
    with open(status, encoding='ascii') as file:
        mask = next(line for line in file if line.startswith('SigBlk'))
    return int(mask.split()[1], 16) >> (number - 1) & 1

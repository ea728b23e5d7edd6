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

"""A bag goes in and the same bytes come out over DDS, with a clock."""

import time

from bag_writer import NS, pair_messages, write_messages
from listener import KIND_OF, replaying, stamp_ns
import numpy as np
from printed import own_lines
import pytest
from rosgraph_msgs.msg import Clock

from stereo_refine_ros.datasets import render_scene

pytestmark = pytest.mark.ros
CAMERA = {name: kind for name, kind in KIND_OF.items() if 'truth' not in name}
PAIRS = 5


def _record(path, storage):
    scenes = [render_scene(seed, 120, 160, 24, 2) for seed in range(PAIRS)]
    views = [(scene.pair.left, scene.pair.right) for scene in scenes]
    return write_messages(path, storage, pair_messages(views, scenes[0].geometry))


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    """Return the path of a bag of five pairs at 10 Hz."""
    path = tmp_path_factory.mktemp('bags') / 'bag'
    _record(path, 'mcap')
    return path


def _ticks(listener):
    return [tick.clock.sec * NS + tick.clock.nanosec for tick in listener.received['/clock']]


def _has(listener, count):
    return lambda: all(len(listener.received[name]) >= count for name in CAMERA)


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
def test_messages_come_out_as_they_were_recorded(listen, tmp_path, storage):
    path = tmp_path / 'bag'
    raw = _record(path, storage)
    listener = listen(CAMERA, raw=True)
    with replaying('--bag', path):
        listener.wait(_has(listener, PAIRS))
    for name in CAMERA:
        received, recorded = listener.received[name], raw[f'/{name}']
        # DDS fills the payload up to four bytes.
        assert [len(message) // 4 for message in received] == [
            (len(message) + 3) // 4 for message in recorded]
        assert [bytes(got[:len(was)]) for got, was in zip(received, recorded, strict=True)
                ] == recorded


def test_clock_runs_with_the_bag(listen, bag):
    listener = listen({**CAMERA, '/clock': Clock}, use_sim_time=True)
    with replaying('--bag', bag, '--clock'):
        listener.wait(_has(listener, PAIRS))
        last = 1000 * NS + (PAIRS - 1) * NS // 10
        listener.wait(lambda: _ticks(listener)[-1:] == [last])
        listener.wait(lambda: listener.node.get_clock().now().nanoseconds == last)
    ticks = _ticks(listener)
    assert ticks == sorted(ticks)
    assert ticks[0] == 1000 * NS
    assert np.median(np.diff(ticks)) < 0.03 * NS  # many between two messages


def test_loops_go_back_in_time_and_speed_is_a_factor(listen, bag):
    listener = listen({**CAMERA, '/clock': Clock})
    with replaying('--bag', bag, '--loop', 2, '--rate', 4, '--clock', 50):
        listener.wait(_has(listener, 2 * PAIRS))
    stamps = [stamp_ns(message) for message in listener.received['left/image_rect']]
    once = [1000 * NS + index * NS // 10 for index in range(PAIRS)]
    assert stamps == once * 2
    ticks = _ticks(listener)
    assert sum(np.diff(ticks) < 0) == 1


def test_topics_can_be_chosen_and_remapped(listen, bag):
    listener = listen({'/cam/left': KIND_OF['left/image_rect'],
                       '/right/image_rect': KIND_OF['right/image_rect']})
    with replaying('--bag', bag, '--rate', 4, '--topics', '/left/image_rect,/left/camera_info',
                   '--ros-args', '-r', '/left/image_rect:=/cam/left') as process:
        listener.wait(lambda: len(listener.received['/cam/left']) >= PAIRS)
        out, _ = process.communicate(timeout=40)
    assert own_lines(out) == f'replay: published {2 * PAIRS} messages\n'
    assert listener.received['/right/image_rect'] == []


def _left_stamps(listener):
    return [(stamp_ns(message) - 1000 * NS) * 10 // NS
            for message in listener.received['left/image_rect']]


def test_offset_and_duration_are_seconds_of_the_bag(listen, bag):
    listener = listen(CAMERA)
    with replaying('--bag', bag, '--start-offset', 0.1, '--playback-duration', 0.25) as process:
        listener.wait(_has(listener, 3))
        out, _ = process.communicate(timeout=40)
    assert own_lines(out) == 'replay: published 12 messages\n'
    assert _left_stamps(listener) == [1, 2, 3]


def test_topics_as_a_list_some_left_out_and_no_clock_unless_asked(listen, bag):
    listener = listen({**CAMERA, '/clock': Clock})
    with replaying('--bag', bag, '-r', 4, '--topics', '/left/image_rect', '/left/camera_info',
                   '/right/image_rect', '--exclude-topics', '/left/camera_info') as process:
        out, _ = process.communicate(timeout=40)
        listener.wait(lambda: _left_stamps(listener) == [0, 1, 2, 3, 4])
    assert own_lines(out) == f'replay: published {2 * PAIRS} messages\n'
    assert not any(listener.received[name] for name in (
        '/clock', 'left/camera_info', 'right/camera_info'))


def test_delay_comes_before_the_first_message(listen, bag):
    listener = listen(CAMERA)
    with replaying('--bag', bag, '-r', 100, '--delay', 1.5, '--wait', 20) as process:
        listener.wait(lambda: listener.node.count_publishers('left/image_rect') > 0)
        begin = time.monotonic()
        listener.wait(_has(listener, 1))
        assert time.monotonic() - begin > 1.2
        process.communicate(timeout=40)


def test_offset_beyond_the_end_is_refused(bag):
    with replaying('--bag', bag, '--start-offset', 99) as process:
        _, err = process.communicate(timeout=20)
    assert process.returncode == 1
    assert '--start-offset 99: the bag is 0.4 s long' in err and 'Traceback' not in err


def test_bag_without_the_topics_asked_for_is_refused(bag):
    with replaying('--bag', bag, '--topics', '/absent') as process:
        _, err = process.communicate(timeout=20)
    assert process.returncode == 1
    assert 'no messages that can be published' in err and 'Traceback' not in err
    assert '/left/image_rect' in err

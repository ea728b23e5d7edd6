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

"""What `replay` publishes, received over DDS from a process of its own."""

from pathlib import Path
import signal
import time

import cv2
from listener import BEST_EFFORT, KIND_OF, pixels, replaying, stamp_ns
import numpy as np
from printed import own_lines
import pytest
from real_scenes import real_scene_folder

from stereo_refine_ros import dds_profile
from stereo_refine_ros.datasets import iterate_folder, load_scene, render_scene

pytestmark = pytest.mark.ros


def _has(listener, count, topics=KIND_OF):
    return lambda: all(len(listener.received[topic]) >= count for topic in topics)


def test_synthetic_pair_arrives_bit_for_bit(listen):
    listener = listen()
    with replaying('--synthetic', '--seed', 4):
        listener.wait(_has(listener, 1))
    scene = render_scene(4)
    got = {topic: messages[0] for topic, messages in listener.received.items()}
    assert len({stamp_ns(message) for message in got.values()}) == 1
    assert {message.header.frame_id for message in got.values()} == {'left_camera_optical_frame'}
    for side, view in (('left', scene.pair.left), ('right', scene.pair.right)):
        message = got[f'{side}/image_rect']
        assert (message.encoding, message.step, message.is_bigendian) == ('bgr8', 320 * 3, 0)
        np.testing.assert_array_equal(pixels(message), view)
    truth = got['ground_truth/disparity']
    np.testing.assert_array_equal(pixels(truth.image, np.float32), scene.truth)
    assert (truth.f, truth.t) == (pytest.approx(288.0), pytest.approx(0.12))
    assert (truth.min_disparity, truth.max_disparity) == (0.0, 47.0)
    assert truth.image.header == truth.header
    assert (truth.valid_window.width, truth.valid_window.height) == (320, 240)


def test_camera_info_and_truth_carry_the_offset_of_the_principal_points(listen):
    listener = listen()
    with replaying('--scene', 'teddy'):
        listener.wait(_has(listener, 1))
    left, right = (listener.received[f'{side}/camera_info'][0] for side in ('left', 'right'))
    assert (left.width, left.height) == (right.width, right.height) == (450, 375)
    np.testing.assert_array_equal(left.p, [1500, 0, 199, 0, 0, 1500, 187, 0, 0, 0, 1, 0])
    np.testing.assert_array_equal(right.p, [1500, 0, 251, -120, 0, 1500, 187, 0, 0, 0, 1, 0])
    np.testing.assert_array_equal(left.k, [1500, 0, 199, 0, 1500, 187, 0, 0, 1])
    np.testing.assert_array_equal(left.r, np.eye(3).ravel())
    assert (left.distortion_model, list(left.d)) == ('plumb_bob', [0.0] * 5)
    scene, truth = load_scene('teddy'), listener.received['ground_truth/disparity'][0]
    known = np.isfinite(scene.truth)
    values = pixels(truth.image, np.float32)
    np.testing.assert_array_equal(values[known], scene.truth[known] + 52)
    assert (values[~known] == 51).all() and not known.all()
    assert (truth.min_disparity, truth.max_disparity) == (52.0, 111.0)
    assert truth.delta_d == 0.25


def test_scenes_at_a_rate_as_often_as_asked_in_grey_to_best_effort(listen):
    names = ['left/image_rect', 'right/image_rect']
    listener = listen({name: KIND_OF[name] for name in names}, qos=BEST_EFFORT)
    with replaying('--scene', 'tsukuba,venus', '--loop', 3, '--rate', 10,
                   '--encoding', 'mono8') as process:
        listener.wait(_has(listener, 6, names))
        out, _ = process.communicate(timeout=40)
    assert process.returncode == 0
    assert own_lines(out) == 'replay: published 6 pairs\n'
    messages = listener.received['left/image_rect']
    assert [message.width for message in messages] == [384, 434] * 3
    grey = cv2.cvtColor(load_scene('tsukuba').pair.left, cv2.COLOR_BGR2GRAY)
    assert messages[0].encoding == 'mono8'
    np.testing.assert_array_equal(pixels(messages[0]), grey)
    stamps = [stamp_ns(message) for message in messages]
    assert stamps == [stamp_ns(message) for message in listener.received['right/image_rect']]
    assert np.median(np.diff(stamps)) == pytest.approx(1e8, rel=0.3)  # a busy machine slips one


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_endless_loop_in_a_namespace_ends_clean_on_a_signal(listen, number):
    remapped = {'left/image_rect': KIND_OF['left/image_rect'],
                '/elsewhere': KIND_OF['right/image_rect']}
    listener = listen(remapped, namespace='robot')
    with replaying('--synthetic', '--loop', '--rate', 20, '--ros-args', '-r', '__ns:=/robot',
                   '-r', 'right/image_rect:=/elsewhere') as process:
        listener.wait(lambda: all(len(got) > 3 for got in listener.received.values()))
        process.send_signal(number)
        _, err = process.communicate(timeout=20)
    assert process.returncode == 0
    assert 'Traceback' not in err


def test_a_signal_at_any_moment_of_the_start_ends_it():
    for delay_s in (0.0, 0.3, 0.5, 0.7, 0.9, 1.2):
        with replaying('--synthetic', '--wait', 600) as process:
            while not blocks(process.pid, signal.SIGINT):
                time.sleep(0.01)  # what comes before is the interpreter's
            time.sleep(delay_s)  # from the imports to the wait for subscribers
            process.send_signal(signal.SIGINT)
            _, err = process.communicate(timeout=20)
        assert process.returncode == 0, (delay_s, err)


def blocks(pid, number):
    """Return whether the first thread of a process blocks a signal."""
    status = Path(f'/proc/{pid}/status').read_text(encoding='ascii')
    mask = next(line.split()[1] for line in status.splitlines() if line.startswith('SigBlk'))
    return bool(int(mask, 16) >> number - 1 & 1)


def test_folder_without_truth(listen, tmp_path):
    for index in range(3):
        for side, level in (('left', 10 * index), ('right', 10 * index + 5)):
            (tmp_path / side).mkdir(exist_ok=True)
            cv2.imwrite(str(tmp_path / side / f'{index}.png'), np.full((6, 8), level, np.uint8))
    listener = listen()
    with replaying('--folder', tmp_path, '--rate', 20, '--encoding', 'mono8'):
        listener.wait(_has(listener, 3, [name for name in KIND_OF if 'truth' not in name]))
    levels = [pixels(message)[0, 0] for message in listener.received['right/image_rect']]
    assert levels == [5, 15, 25]
    assert listener.received['ground_truth/disparity'] == []
    assert listener.received['right/camera_info'][0].p[3] == pytest.approx(-8 * 0.1)


def test_raw_euroc_folder_goes_out_rectified_with_its_calibration(listen):
    folder = real_scene_folder('../sequences/euroc_raw_excerpt')
    topics = {name: kind for name, kind in KIND_OF.items() if 'truth' not in name}
    listener = listen(topics)
    with replaying('--folder', folder, '--rate', 20, '--encoding', 'mono8') as process:
        listener.wait(_has(listener, 1, topics))
        process.terminate()
    expected = next(iter(iterate_folder(folder)))
    np.testing.assert_array_equal(
        pixels(listener.received['left/image_rect'][0]), expected.pair.left)
    info = listener.received['right/camera_info'][0]
    assert info.p[3] / info.p[0] == pytest.approx(-0.11008, abs=1e-5)
    assert list(info.d) == [0.0] * 5


def test_two_patterns(listen, tmp_path):
    for index in range(3):
        for side, level in (('a', 10 * index), ('b', 10 * index + 5)):
            cv2.imwrite(str(tmp_path / f'{side}{index}.png'), np.full((6, 8), level, np.uint8))
    listener = listen()
    with replaying('--left', tmp_path / 'a*', '--right', tmp_path / 'b*', '--rate', 20,
                   '--encoding', 'mono8'):
        listener.wait(_has(listener, 3, ['left/image_rect', 'right/image_rect']))
    levels = [pixels(message)[0, 0] for message in listener.received['right/image_rect']]
    assert levels == [5, 15, 25]


def _largest_segment(process):
    """Bytes of the largest shared memory of Fast DDS that a process has mapped."""
    maps = Path(f'/proc/{process.pid}/maps').read_text().splitlines()
    spans = [line.split()[0].split('-') for line in maps if '/dev/shm/fastrtps_' in line]
    return max((int(end, 16) - int(start, 16) for start, end in spans), default=0)


def test_replay_gives_whole_images_room_by_itself(listen):
    """The 512 KiB that Fast DDS takes by itself lose most colour images."""
    if dds_profile.free_shared_memory() < 256 << 20:
        pytest.skip('too little shared memory')
    listener = listen()
    with replaying('--synthetic', '--loop', '--rate', 20) as process:
        listener.wait(_has(listener, 1))
        assert _largest_segment(process) >= 32 << 20


@pytest.mark.parametrize('options, reason', [
    (['--scene', 'nowhere'], "scene 'nowhere'"), (['--folder', '/nowhere'], 'no pairs'),
    (['--data', '/nowhere'], '--data'), (['--bag', '/nowhere'], 'bag: /nowhere does not exist'),
    (['--bag', '/dev'], 'bag: /dev: '), (['--left', 'a*'], 'go together'),
    (['--left', 'a*', '--right', 'b*'], 'finds 0 images'),
    (['--rate', '0'], '--rate'), (['--row-offset', '200'], '--row-offset'),
    (['--bag', 'b', '--synthetic'], 'not allowed')])
def test_what_cannot_be_played_is_one_clear_error(options, reason):
    with replaying(*options) as process:
        out, err = process.communicate(timeout=20)
    assert process.returncode in (1, 2)
    assert own_lines(out) == '' and 'Traceback' not in err
    assert reason in err.splitlines()[-1]


def test_without_subscribers_it_says_so_and_plays():
    with replaying('--synthetic', '--wait', 0.3) as process:
        out, err = process.communicate(timeout=20)
    assert process.returncode == 0
    assert 'nobody subscribes to /left/image_rect after 0.3 s' in err
    assert 'published 1 pairs' in out

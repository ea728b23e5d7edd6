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

"""Keys on a terminal: `replay --bag` pauses, steps, and leaves the terminal as it was."""

import os
import pty
import subprocess
import sys
import termios

from bag_writer import NS, pair_messages, write_messages
from listener import KIND_OF
from printed import own_lines
import pytest

from stereo_refine_ros.datasets import render_scene
from stereo_refine_ros.replay.keyboard import FASTER, Keyboard, NEXT, PAUSE, SLOWER

pytestmark = pytest.mark.ros
PAIRS = 4


@pytest.fixture
def terminal():
    master, slave = pty.openpty()
    yield master, slave
    os.close(master)
    os.close(slave)


def test_keys_are_read_in_order_and_parts_of_an_arrow_wait():
    keyboard = Keyboard()
    keyboard._typed = b' \x1b[Cx\x1b[A\x1b[B\x1bOC\x1b['
    assert keyboard._take() == [PAUSE, NEXT, FASTER, SLOWER, NEXT]
    keyboard._typed += b'C'
    assert keyboard._take() == [NEXT]


def test_without_a_terminal_there_are_no_keys():
    done = subprocess.run(
        [sys.executable, '-c', 'from stereo_refine_ros.replay.keyboard import Keyboard\n'
         'with Keyboard() as keys: print(keys.is_there, keys.keys())'],
        stdin=subprocess.DEVNULL, capture_output=True, text=True)
    assert done.stdout == 'False []\n', done.stderr


def _leading(slave):
    """Make a terminal that of the new process, which runs in its foreground."""
    def prepare():
        os.setsid()
        import fcntl
        fcntl.ioctl(slave, termios.TIOCSCTTY, 0)
    return prepare


def test_paused_start_steps_and_space(listen, terminal, tmp_path):
    scenes = [render_scene(seed, 48, 64, 16, 1) for seed in range(PAIRS)]
    messages = [item for item in pair_messages(
        [(scene.pair.left, scene.pair.right) for scene in scenes], scenes[0].geometry)
        if item[0] == '/left/image_rect']
    write_messages(tmp_path / 'bag', 'mcap', messages)
    master, slave = terminal
    before = termios.tcgetattr(slave)
    listener = listen({'left/image_rect': KIND_OF['left/image_rect']})
    got = listener.received['left/image_rect']
    with subprocess.Popen(
            [sys.executable, '-m', 'stereo_refine_ros.replay', '--bag', str(tmp_path / 'bag'),
             '--start-paused', '--delay', '0.1'], stdin=slave, stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, text=True, preexec_fn=_leading(slave)) as process:
        try:
            # The terminal is prepared once keys are no longer echoed by lines.
            listener.wait(lambda: not termios.tcgetattr(slave)[3] & termios.ICANON)
            os.write(master, b'\x1b[C')
            listener.wait(lambda: len(got) == 1)
            os.write(master, b'\x1b[C')
            listener.wait(lambda: len(got) == 2)
            os.write(master, b'\x1b[A ')
            listener.wait(lambda: len(got) == PAIRS)
            out, err = process.communicate(timeout=40)
        finally:
            process.kill()
    stamps = [message.header.stamp.sec * NS + message.header.stamp.nanosec for message in got]
    assert stamps == [1000 * NS + index * NS // 10 for index in range(PAIRS)]
    assert own_lines(out) == f'replay: published {PAIRS} messages\n'
    assert 'space: pause' in err and 'rate 1.1' in err and 'going on' in err
    assert termios.tcgetattr(slave) == before

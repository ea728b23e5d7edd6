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

"""The end on a signal: at once before anything is open, told after it, and at last by force."""

import signal
import subprocess
import sys
import time

import pytest

PROCESS = """
import time
from stereo_refine_ros.stop import Stop
stop = Stop({last_resort_s})
print('blocked', flush=True)
{then}
"""
OPENED = """
assert stop.may_open()
stop.on_request = lambda: print('told', flush=True)
print('open', flush=True)
while not stop.requested.is_set():
    try:
        time.sleep(0.01)
    except BaseException:
        pass  # as an import or a destructor may
time.sleep({more_s})
print('closed', flush=True)
"""


def ended(then, *signals, last_resort_s=30.0, ready='blocked'):
    """Return exit code, output and seconds of a process that is sent signals once it is ready."""
    code = PROCESS.format(last_resort_s=last_resort_s, then=then)
    with subprocess.Popen([sys.executable, '-c', code], stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, text=True) as process:
        lines = []
        while ready not in lines:
            lines.append(process.stdout.readline().strip())
        start = time.monotonic()
        for number in signals:
            process.send_signal(number)
        lines += process.stdout.read().split()
        return process.wait(20), lines, time.monotonic() - start


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_before_anything_is_open_a_signal_ends_the_process(number):
    assert ended('time.sleep(15)', number)[:2] == (0, ['blocked'])


@pytest.mark.parametrize('signals', [
    [signal.SIGINT], [signal.SIGTERM], [signal.SIGINT, signal.SIGINT, signal.SIGTERM]])
def test_after_it_whoever_serves_is_told_once_and_ends_in_order(signals):
    code, lines, _ = ended(OPENED.format(more_s=0.1), *signals, ready='open')
    assert (code, lines) == (0, ['blocked', 'open', 'told', 'closed'])


def test_who_does_not_end_is_ended():
    code, lines, seconds = ended(
        OPENED.format(more_s=15), signal.SIGINT, last_resort_s=0.2, ready='open')
    assert (code, lines) == (0, ['blocked', 'open', 'told'])
    assert seconds < 10


def test_who_closes_for_ever_with_the_interpreters_lock_is_ended_too():
    held = 'import ctypes' + OPENED.replace('time.sleep({more_s})', 'ctypes.PyDLL(None).sleep(15)')
    code, lines, seconds = ended(held, signal.SIGINT, last_resort_s=0.5, ready='open')
    assert code == -signal.SIGALRM and 'closed' not in lines
    assert seconds < 10


def test_what_was_asked_for_first_is_not_opened():
    then = 'stop.requested.set()\nprint(stop.may_open())'
    assert ended(then)[:2] == (0, ['blocked', 'False'])

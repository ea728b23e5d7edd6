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

"""The demo's processes are watched and ended, and its messages stay on the host."""

import os
import signal
import subprocess
from types import SimpleNamespace

import pytest

from stereo_refine_ros import dds_profile
from demo.processes import dds_environment, DemoError, Processes  # noqa: I100
from stereo_refine_ros.params import preset_path

CONFIG = preset_path('live').parent


def test_messages_stay_on_the_host_in_a_domain_of_their_own():
    variables = dds_environment(CONFIG)
    assert variables['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'LOCALHOST'
    assert variables['ROS_DOMAIN_ID'] != os.environ['ROS_DOMAIN_ID']


@pytest.mark.parametrize('free, is_used', [(1 << 30, True), (64 << 20, False)])
def test_profile_is_used_where_its_segments_fit(monkeypatch, free, is_used):
    monkeypatch.setattr(
        dds_profile.shutil, 'disk_usage', lambda path: SimpleNamespace(free=free))
    expected = str(CONFIG / 'fastdds_shm.xml') if is_used else None
    variables = dds_environment(CONFIG)
    assert variables.get('FASTRTPS_DEFAULT_PROFILES_FILE') == expected
    assert variables.get('FASTDDS_DEFAULT_PROFILES_FILE') == expected


def test_process_that_ends_is_reported_with_its_log(tmp_path):
    with Processes(tmp_path, {}) as running:
        running.start('replay', '--rate', 'fast')
        running._running['replay'].wait(30)
        with pytest.raises(DemoError, match='(?s)replay ended with status 2.*--rate'):
            running.check()


def test_processes_end_with_the_context(tmp_path):
    with Processes(tmp_path, {'STEREO_REFINE_DATA': ''}) as running:
        running.start('replay', '--synthetic', '--wait', '600')
        process = running._running['replay']
        running.check()
        # Once it listens to signals: before that SIGINT is Python's own.
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(5.0)
    assert process.returncode in (0, -signal.SIGINT)


def test_one_process_ends_and_may_start_again(tmp_path):
    with Processes(tmp_path, {}) as running:
        for _ in range(2):
            running.start('replay', '--synthetic', '--wait', '600')
            process = running._running['replay']
            # Once the interpreter is up: before that a signal makes it fail by itself.
            with pytest.raises(subprocess.TimeoutExpired):
                process.wait(1.0)
            running.end('replay')
            assert process.returncode in (0, 130, -signal.SIGINT)
            running.check()

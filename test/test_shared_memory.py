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

"""Shared memory for images is taken as there is room, and where there is none it is said."""

from pathlib import Path
import re
import shutil
import subprocess
import sys
import tempfile
from types import SimpleNamespace
from xml.etree import ElementTree

import pytest
from stereo_refine_ros import shared_memory
from stereo_refine_ros.shared_memory import fit_to_host, PROFILE_VARIABLES

ROOT = Path(__file__).resolve().parents[1]
OWN = [str(ROOT / 'config' / name) for name in ('fastdds_shm.xml', 'fastdds_two_hosts.xml')]
MB = 1 << 20
SPACE = {'p': 'http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles'}

CONTAINER = 'mount -t tmpfs -o size=64m none /dev/shm && exec "$0" -c "$1" "$2"'
# A driver of somebody else's takes its 32 MB; replay and node start beside it.
BESIDE_A_DRIVER = """
import os, subprocess, sys
for name in 'FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE':
    os.environ[name] = sys.argv[1]
import rclpy
rclpy.init()
driver = rclpy.create_node('driver')
replay = subprocess.run(
    [sys.executable, '-m', 'stereo_refine_ros.replay', '--synthetic', '--wait', '0'],
    capture_output=True, text=True, timeout=60)
print('REPLAY', replay.returncode, replay.stderr)
node = subprocess.Popen([sys.executable, '-m', 'stereo_refine_ros.refine_node'],
                        stderr=subprocess.PIPE, text=True)
for line in node.stderr:
    print('NODE', line)
    if 'compiling' in line:
        node.terminate()
"""


def reduced(monkeypatch, profile, free, total=64 * MB, **environment):
    """Fit a profile to a host with so much room; return what was said, and the environment."""
    monkeypatch.setattr(shutil, 'disk_usage',
                        lambda path: SimpleNamespace(free=free, total=total))
    monkeypatch.setattr(shared_memory, 'MEMORY', Path(tempfile.gettempdir()))
    said = []
    environment = {**dict.fromkeys(PROFILE_VARIABLES, profile), **environment}
    fit_to_host(said.append, environment)
    return said, environment


def values(path, name):
    found = ElementTree.parse(path).getroot().iterfind(f'.//p:{name}', SPACE)
    return [item.text for item in found]


@pytest.mark.parametrize('profile', OWN)
def test_where_there_is_room_nothing_changes_and_nothing_is_said(monkeypatch, profile):
    said, environment = reduced(monkeypatch, profile, 4096 * MB, 8192 * MB)
    assert said == [] and set(environment.values()) == {profile}


@pytest.mark.parametrize('profile', OWN)
def test_in_a_container_a_quarter_of_what_is_free_is_taken(monkeypatch, profile):
    said, environment = reduced(monkeypatch, profile, 64 * MB)
    assert said[0].startswith(
        f'{tempfile.gettempdir()} has 64 of 64 MB free: this process takes 15 MB')
    assert 'docker run --shm-size=512m' in said[0] and 'fastdds shm clean' in said[0]
    path, = set(environment.values())
    sizes = list(map(int, values(path, 'segment_size')))
    assert sizes == [int(63 * MB / 4 / 1.05)]
    # The rest is as it was.
    for name in 'transport_id', 'useBuiltinTransports', 'port_queue_capacity', 'sec', 'nanosec':
        assert values(path, name) == values(profile, name)
    assert max(map(int, values(path, 'maxMessageSize'))) <= sizes[0]


def test_a_little_less_is_not_worth_a_word(monkeypatch):
    said, environment = reduced(monkeypatch, OWN[0], 128 * MB, 128 * MB)
    size, = map(int, values(environment[PROFILE_VARIABLES[0]], 'segment_size'))
    assert said == [] and 30 * MB < size < 32 * MB


def test_four_processes_fit_into_a_container_one_after_another(monkeypatch):
    free, taken = 64 * MB, []
    for _ in range(4):
        _, environment = reduced(monkeypatch, OWN[0], free)
        taken.append(int(values(environment[PROFILE_VARIABLES[0]], 'segment_size')[0]))
        free -= int(taken[-1] * 1.05) + MB
    assert free > 0 and min(taken) > 5 * MB


def test_where_there_is_next_to_none_udp_remains(monkeypatch):
    said, environment = reduced(monkeypatch, OWN[0], 3 * MB)
    assert 'too little for images: they go by UDP' in said[0] and '--shm-size' in said[0]
    path = environment[PROFILE_VARIABLES[0]]
    assert values(path, 'type') == ['UDPv4']
    assert values(path, 'transport_id') == ['udp_rest', 'udp_rest']


def test_the_profile_of_somebody_else_is_left_and_its_fault_told(monkeypatch, tmp_path):
    theirs = tmp_path / 'theirs.xml'
    text = Path(OWN[0]).read_text(encoding='utf-8')
    theirs.write_text(text.replace('stereo_refine_shm', 'camera'), encoding='utf-8')
    said, environment = reduced(monkeypatch, str(theirs), 30 * MB)
    assert set(environment.values()) == {str(theirs)}
    assert re.search(rf'30 of 64 MB free, {theirs} asks for 32 MB .* may not arrive.*--shm-size',
                     said[0])
    assert reduced(monkeypatch, str(theirs), 40 * MB)[0] == []


@pytest.mark.parametrize('environment', [
    {'RMW_IMPLEMENTATION': 'rmw_cyclonedds_cpp'},
    dict.fromkeys(PROFILE_VARIABLES, ''), dict.fromkeys(PROFILE_VARIABLES, '/none.xml'),
    dict.fromkeys(PROFILE_VARIABLES, str(ROOT / 'setup.py'))])
def test_where_no_profile_is_read_nothing_is_said(monkeypatch, environment):
    before = {**dict.fromkeys(PROFILE_VARIABLES, OWN[0]), **environment}
    said, after = reduced(monkeypatch, OWN[0], MB, **environment)
    assert said == [] and after == before


def test_shared_memory_that_cannot_be_written_is_told(monkeypatch):
    def refuse(**options):
        raise PermissionError(13, 'Permission denied')
    monkeypatch.setattr(tempfile, 'NamedTemporaryFile', refuse)
    said, environment = reduced(monkeypatch, OWN[0], 30 * MB)
    assert 'cannot be written ([Errno 13] Permission denied)' in said[0]
    assert set(environment.values()) == {OWN[0]}


@pytest.mark.ros
def test_replay_and_node_find_room_beside_a_driver(tmp_path):
    theirs = subprocess.run(['unshare', '-rm', 'true'], capture_output=True)
    if theirs.returncode:
        pytest.skip('needs the right to mount: ' + theirs.stderr.decode())
    done = subprocess.run(
        ['unshare', '-rm', 'sh', '-c', CONTAINER, sys.executable, BESIDE_A_DRIVER, OWN[0]],
        capture_output=True, text=True, timeout=120, cwd=ROOT)
    assert done.returncode == 0 and 'REPLAY 0' in done.stdout, done.stdout + done.stderr
    replay, node = done.stdout.split('NODE', 1)
    for printed in replay, node:
        assert re.search(r'this process takes \d MB of it.*--shm-size', printed)
        assert 'RTPS_TRANSPORT_SHM' not in printed, printed

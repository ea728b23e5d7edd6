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

"""Every test run talks to this host only, in a DDS domain of its own; a test that hangs ends."""

import faulthandler
import fcntl
import os
from pathlib import Path

import pytest
from stereo_refine_ros.dds_domain import claim_domain

# Several times what the longest takes beside two busy loops.
_LIMIT_S = 600.0

_MEMORY = Path('/dev/shm')


def _is_held(lock):
    """Whether a process lives that Fast DDS made a lock file for."""
    try:
        with open(lock, encoding='utf-8') as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except FileNotFoundError:
        return False
    except OSError:
        return True
    return False


def _clear_shared_memory():
    """
    Remove what killed processes left, as `fastdds shm clean` does.

    Tests kill processes. Once 300 segments of dead ones were there, a busy machine lost the most
    of the messages beside a stopped reader; without them none.
    """
    for file in _MEMORY.glob('fastrtps_*'):
        locks = [Path(f'{file}{end}') for end in ('_el', '_sl')]
        if not file.name.endswith(('_el', '_sl')) and not any(map(_is_held, locks)):
            for left in (file, *locks, _MEMORY / f'sem.{file.name}_mutex'):
                left.unlink(missing_ok=True)


if 'PYTEST_XDIST_WORKER' not in os.environ and _MEMORY.is_dir():
    _clear_shared_memory()

os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
# Workers side by side inherit the domain of the process that started them.
if 'ROS_DOMAIN_ID' not in os.environ or 'PYTEST_XDIST_WORKER' in os.environ:
    os.environ['ROS_DOMAIN_ID'] = claim_domain()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item):
    """
    End the process in which a test takes too long, with its traceback.

    Fast DDS was seen to spin for ever while a node closed, which no exception gets out of.
    """
    handler = item.config.pluginmanager.get_plugin('faulthandler')
    file = item.config.stash.get(handler.fault_handler_stderr_fd_key, 2)
    faulthandler.dump_traceback_later(_LIMIT_S, exit=True, file=file)
    try:
        return (yield)
    finally:
        faulthandler.cancel_dump_traceback_later()

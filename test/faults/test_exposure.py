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

"""What the node opens: it writes its kernel cache and ROS's log, calls nobody."""

import os
from pathlib import Path
import signal
import subprocess
import sys
import tempfile

from harness import Client, reliable_inputs, stereo_messages, textured_pair
import pytest
from stereo_msgs.msg import DisparityImage

pytestmark = pytest.mark.ros
ROOT = Path(__file__).resolve().parents[2]

# Python's audit events, before anything of the node is imported.
WATCHED = """
import os, sys
def watch(event, args):
    writes = event == 'open' and isinstance(args[2], int) and args[2] & (
        os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC)
    if writes or event.split('.')[0] in ('subprocess', 'socket', 'shutil', 'urllib', 'ftplib') \
            or event in ('os.system', 'os.exec', 'os.fork', 'os.posix_spawn', 'os.remove',
                         'os.rename', 'os.mkdir', 'os.rmdir', 'os.symlink', 'os.link'):
        os.write(log, f'{event} {args}\\n'.encode())
log = os.open(sys.argv.pop(1), os.O_WRONLY | os.O_APPEND)
sys.addaudithook(watch)
from stereo_refine_ros.refine_node import main
sys.exit(main())
"""


def _own_environment():
    """Leave out what would let coverage write its own files from the node's process."""
    return {name: value for name, value in os.environ.items()
            if not name.startswith('COVERAGE_')}


def test_only_the_kernel_cache_is_written_and_only_its_compiler_started(tmp_path):
    cache, logs = os.environ['NUMBA_CACHE_DIR'], tmp_path / 'logs'  # set by the package
    with tempfile.NamedTemporaryFile('r') as events:
        node = subprocess.Popen(
            [sys.executable, '-c', WATCHED, events.name, '--ros-args', *reliable_inputs(),
             '-p', 'matching.num_disparities:=16'],
            cwd=ROOT, stderr=subprocess.PIPE, text=True, env={
                **_own_environment(), 'ROS_LOG_DIR': str(logs), 'HOME': str(tmp_path),
                'PYTHONDONTWRITEBYTECODE': '1'})
        client = Client()
        try:
            client.subscribe('disparity', DisparityImage)
            sent = stereo_messages(*textured_pair(48, 32), 10 ** 9)
            client.connect(sent, timeout_s=60.0)
            client.exchange(sent, timeout_s=60.0)
        finally:
            client.close()
            node.send_signal(signal.SIGINT)
            _, printed = node.communicate(timeout=10)
        assert node.returncode == 0, printed
        written = events.read().splitlines()
    # A first start has a process of its own compile into the cache.
    assert [line for line in written
            if cache not in line and 'stereo_refine_ros.warm_up' not in line] == []
    # The middleware's own C++ code is not seen by Python: look at what is on the disk.
    made = {path.relative_to(tmp_path).parts[0] for path in tmp_path.rglob('*')}
    assert made <= {'logs'}

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

"""The node as a process of its own, for measurements: its log, its shared memory, its end."""

from __future__ import annotations

import os
from pathlib import Path
import signal
import subprocess
import sys
import tempfile
import time

import psutil

ROOT = Path(__file__).resolve().parents[1]
SHARED_MEMORY = '/dev/shm/'


def left_behind(files: set[tuple[str, int]], grace_s: float = 3.0) -> list[str]:
    """
    Return those of a dead process's files that are still there and that nobody else has mapped.

    Ports are shared with every other participant on the host, which may take a moment to let go.
    """
    end = time.monotonic() + grace_s
    while True:
        left = [path for path, inode in sorted(files)
                if _inode(path) == inode and not _is_mapped(path)]
        if not left or time.monotonic() > end:
            return left
        time.sleep(0.3)


def _inode(path: str | Path) -> int:
    try:
        return os.stat(path).st_ino
    except FileNotFoundError:
        return -1


def _is_mapped(path: str) -> bool:
    for maps in Path('/proc').glob('[0-9]*/maps'):
        try:
            if path in maps.read_text():
                return True
        except OSError:
            continue  # gone by now, or somebody else's
    return False


class NodeRun:
    """
    A node process and what it printed.

    Parameters
    ----------
    ros_args : sequence of str
        What follows `--ros-args`.

    """

    def __init__(self, *ros_args: str) -> None:
        """Start the process; it is not ready yet."""
        self._log = tempfile.NamedTemporaryFile('w+', suffix='.log')
        self._before = {(str(path), _inode(path)) for path in Path(SHARED_MEMORY).iterdir()}
        command = [sys.executable, '-u', '-m', 'stereo_refine_ros.refine_node']
        self.process = subprocess.Popen(
            [*command, '--ros-args', *ros_args] if ros_args else command,
            stdout=self._log, stderr=subprocess.STDOUT, cwd=ROOT)
        self.info = psutil.Process(self.process.pid)

    @property
    def log(self) -> str:
        """All that the process has printed so far."""
        return Path(self._log.name).read_text(encoding='utf-8')

    def wait_for(self, text: str, timeout_s: float = 60.0) -> None:
        """Wait until the log holds a text."""
        end = time.monotonic() + timeout_s
        while text not in self.log:
            if time.monotonic() > end or self.process.poll() is not None:
                raise RuntimeError(f'no {text!r} in the log:\n{self.log}')
            time.sleep(0.01)

    def wait_for_own_code(self, timeout_s: float = 20.0) -> None:
        """Wait until the node has blocked SIGINT, the first thing that it does."""
        status, end = Path(f'/proc/{self.process.pid}/status'), time.monotonic() + timeout_s
        bit = 1 << signal.SIGINT - 1
        while not int(status.read_text().split('SigBlk:')[1].split()[0], 16) & bit:
            if time.monotonic() > end:
                raise RuntimeError(f'the node does not start:\n{self.log}')
            time.sleep(0.001)

    def shared_memory(self) -> set[tuple[str, int]]:
        """
        Return path and inode of the files under /dev/shm that came with the process.

        Older ones that it maps are ports of others; a participant that was killed leaves them.
        """
        maps = Path(f'/proc/{self.process.pid}/maps').read_text()
        fields = [line.split() for line in maps.splitlines()
                  if SHARED_MEMORY in line and not line.endswith('(deleted)')]
        return {(field[5], int(field[4])) for field in fields} - self._before

    def end(self, *signals: int, gap_s: float = 0.0, timeout_s: float = 10.0) -> float:
        """Send signals; return the seconds until the process was gone (it is killed at last)."""
        began = time.monotonic()
        for number in signals or (signal.SIGINT,):
            self.process.send_signal(number)
            time.sleep(gap_s)
        try:
            self.process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        return time.monotonic() - began

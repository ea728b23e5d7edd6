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

"""The processes of the demo: started together, watched, ended together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import os
from pathlib import Path
import signal
import subprocess
import sys
from types import TracebackType

from stereo_refine_ros.dds_domain import claim_domain
from stereo_refine_ros.dds_profile import profile_variables

_END_S = 8.0
_TAIL_LINES = 15


class DemoError(RuntimeError):
    """The demo cannot go on; the text says why and what to look at."""


def dds_environment(config: Path) -> dict[str, str]:
    """
    Return the variables that keep the demo's messages on this host and whole.

    The domain is the demo's own, so that no robot nearby is disturbed, and the profile gives
    images shared memory large enough for them.
    """
    variables = {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
                 'ROS_DOMAIN_ID': claim_domain()}
    return {**profile_variables(config, {}), **variables}


class Processes:
    """
    Python modules run as processes that log to files.

    Parameters
    ----------
    logs : Path
        Folder of the log files.
    variables : mapping of str to str
        Added to this process's environment.

    """

    def __init__(self, logs: Path, variables: Mapping[str, str]) -> None:
        """Start nothing yet."""
        self._logs = logs
        self._environment = {**os.environ, **variables, 'PYTHONUNBUFFERED': '1'}
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, name: str, *arguments: str) -> None:
        """Run `python -m stereo_refine_ros.NAME ARGUMENTS`."""
        with self._log(name).open('wb') as log:
            self._running[name] = subprocess.Popen(
                [sys.executable, '-m', f'stereo_refine_ros.{name}', *arguments],
                env=self._environment, stdin=subprocess.DEVNULL, stdout=log,
                stderr=subprocess.STDOUT, start_new_session=True)

    def end(self, name: str) -> None:
        """End one process as a user would, with SIGINT."""
        process = self._running.pop(name)
        _interrupt(process)
        _wait(process)

    def check(self) -> None:
        """Raise DemoError, with the end of its log, when a process has ended."""
        for name, process in self._running.items():
            if process.poll() is not None:
                raise DemoError(f'{name} ended with status {process.returncode}\n'
                                + self.tails([name]))

    def tails(self, names: Sequence[str] = ()) -> str:
        """Return the last lines of the logs of `names`, or of all."""
        parts = []
        for name in names or self._running:
            lines = self._log(name).read_text(encoding='utf-8', errors='replace').splitlines()
            parts.append('\n'.join([f'--- {self._log(name)}', *lines[-_TAIL_LINES:]]))
        return '\n'.join(parts)

    def stop(self) -> None:
        """End all processes as a user would, with SIGINT; kill what does not end."""
        for process in self._running.values():
            _interrupt(process)
        for process in self._running.values():
            _wait(process)

    def _log(self, name: str) -> Path:
        return self._logs / f'{name}.log'

    def __enter__(self) -> Processes:
        """Return itself."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        """End all processes."""
        self.stop()


def _interrupt(process: subprocess.Popen[bytes]) -> None:
    if process.poll() is None:
        process.send_signal(signal.SIGINT)


def _wait(process: subprocess.Popen[bytes]) -> None:
    try:
        process.wait(_END_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()

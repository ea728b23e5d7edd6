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

"""The end of a process on SIGINT or SIGTERM, at whatever moment they come."""

from __future__ import annotations

from collections.abc import Callable
import math
import os
import signal
import threading
import time

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Stop:
    """
    Wait for a signal in a thread, and tell whoever serves the process.

    Where a signal is an exception, an import or a destructor that catches it loses it. Here it
    is no exception, and no more than the first of them counts.

    Attributes
    ----------
    requested : threading.Event
        Set once a signal has come.
    on_request : callable, or None
        Called then, in the thread that waited.

    """

    def __init__(self, last_resort_s: float) -> None:
        """
        Block the signals in this and every later thread, and start to wait for them.

        A process that has not ended `last_resort_s` after one came is ended without more ado.
        """
        signal.pthread_sigmask(signal.SIG_BLOCK, _SIGNALS)
        self.requested = threading.Event()
        self.on_request: Callable[[], object] | None = None
        self._last_resort_s = last_resort_s
        self._lock = threading.Lock()
        self._has_opened = False
        threading.Thread(target=self._wait, name='signals', daemon=True).start()

    def may_open(self) -> bool:
        """Whether to go on to what has to be closed again; before, a signal ends at once."""
        with self._lock:
            self._has_opened = not self.requested.is_set()
            return self._has_opened

    def closes(self) -> None:
        """
        Let the system end the process if closing takes twice the last resort.

        Fast DDS was seen to spin for ever where a node closes, with the interpreter's lock held:
        no thread of Python's gets on then.
        """
        signal.alarm(math.ceil(2 * self._last_resort_s))

    def _wait(self) -> None:
        signal.sigwait(_SIGNALS)
        self.closes()
        with self._lock:
            self.requested.set()
            if not self._has_opened:
                os._exit(0)  # imports may take seconds on a busy machine
        tell = self.on_request
        if tell is not None:
            tell()
        time.sleep(self._last_resort_s)
        os._exit(0)

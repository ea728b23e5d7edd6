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

"""Keys pressed on a terminal, read without waiting for them."""

from __future__ import annotations

import os
import select
import termios
import tty
from types import TracebackType
from typing import Any

PAUSE, NEXT, FASTER, SLOWER = 'pause', 'next', 'faster', 'slower'
HELP = 'space: pause or go on; right arrow: next message; up, down: faster, slower'
_KEYS = {b' ': PAUSE, b'\x1b[C': NEXT, b'\x1b[A': FASTER, b'\x1b[B': SLOWER,
         b'\x1bOC': NEXT, b'\x1bOA': FASTER, b'\x1bOB': SLOWER}  # as some terminals send them


class Keyboard:
    """
    The terminal of this process, if it has one and runs in the foreground.

    Within `with` keys come at once and unseen; afterwards the terminal is as it was.
    """

    def __init__(self, is_wanted: bool = True) -> None:
        """Leave the terminal alone until `with`, and then too where it is not wanted."""
        self._is_wanted = is_wanted
        self._before: list[Any] | None = None
        self._typed = b''

    @property
    def is_there(self) -> bool:
        """Whether keys can come."""
        return self._before is not None

    def keys(self) -> list[str]:
        """Return what was pressed since the last call, in order."""
        if self._before is None:
            return []
        while select.select([0], [], [], 0)[0]:
            read = os.read(0, 64)
            if not read:
                break
            self._typed += read
        return self._take()

    def _take(self) -> list[str]:
        found = []
        while self._typed:
            code = next((code for code in _KEYS if self._typed.startswith(code)), b'')
            if not code and any(known.startswith(self._typed) for known in _KEYS):
                break  # the rest of an arrow is still on its way
            found += [_KEYS[code]] if code else []
            self._typed = self._typed[len(code) or 1:]
        return found

    def __enter__(self) -> Keyboard:
        """Take keys one by one, where there is a terminal to take them from."""
        try:
            # A process in the background that touches its terminal is stopped.
            if self._is_wanted and os.isatty(0) and os.tcgetpgrp(0) == os.getpgrp():
                self._before = termios.tcgetattr(0)
                tty.setcbreak(0)
        except (OSError, ValueError, termios.error):
            self._before = None
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        """Leave the terminal as it was."""
        if self._before is not None:
            termios.tcsetattr(0, termios.TCSADRAIN, self._before)

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

"""Progress on standard error: a moving bar in a terminal, plain lines in a log."""

from __future__ import annotations

import sys
from types import TracebackType
from typing import TextIO

_WIDTH = 30


class Progress:
    """Counts steps; use it in a `with` statement, so that an error starts on a new line."""

    def __init__(self, total: int | None = None, stream: TextIO | None = None) -> None:
        """Prepare for `total` steps, None where nobody knows how many."""
        self._total = total
        self._done = 0
        self._stream = stream or sys.stderr

    def __enter__(self) -> Progress:
        """Return itself."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        """Leave the bar's line."""
        if self._stream.isatty():
            self._stream.write('\n')

    def step(self, text: str) -> None:
        """Count one step as done and show what it was."""
        self._done += 1
        line = f'{self._done} {text}' if self._total is None else (
            f'{self._bar(self._total)}{self._done}/{self._total} {text}')
        is_terminal = self._stream.isatty()
        self._stream.write(f'\r\x1b[K{line}' if is_terminal else f'{line}\n')
        self._stream.flush()

    def _bar(self, total: int) -> str:
        if not self._stream.isatty():
            return ''
        filled = _WIDTH * self._done // total
        return '[' + '#' * filled + '.' * (_WIDTH - filled) + '] '

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

"""A progress line on standard error; silent lines in a log, a moving bar in a terminal."""

from __future__ import annotations

import sys
from types import TracebackType
from typing import TextIO

_WIDTH = 30


class Progress:
    """Counts steps; use it in a `with` statement, so that an error starts on a new line."""

    def __init__(self, total: int, stream: TextIO | None = None) -> None:
        """Prepare for `total` steps."""
        self._total = max(total, 1)
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
        self._done = min(self._done + 1, self._total)
        count = f'{self._done}/{self._total} {text}'
        if self._stream.isatty():
            filled = _WIDTH * self._done // self._total
            bar = '#' * filled + '.' * (_WIDTH - filled)
            self._stream.write(f'\r\x1b[K[{bar}] {count}')
        else:
            self._stream.write(count + '\n')
        self._stream.flush()

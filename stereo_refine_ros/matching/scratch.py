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

"""
Arrays to work in, kept from one frame to the next.

Fresh pages for the tens of megabytes that a frame works in cost as long as filling them does.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import threading

import numpy as np
from numpy.typing import NDArray

LINE = 64  # bytes of a cache line: a vector that lies across two costs twice
_MOST_IDLE = 12
_idle: list[NDArray[np.uint8]] = []
_lock = threading.Lock()


@contextmanager
def scratch(size: int) -> Iterator[NDArray[np.uint8]]:
    """
    Lend an uint8 array, on a cache line, until the block ends; what it holds is arbitrary.

    Any thread may ask, and gets one that nobody else has; the longest unused ones are dropped.
    """
    array = _take(size)
    try:
        yield array
    finally:
        with _lock:
            _idle.append(array)
            del _idle[:-_MOST_IDLE]


def _take(size: int) -> NDArray[np.uint8]:
    with _lock:
        for i in reversed(range(len(_idle))):
            if _idle[i].size == size:
                return _idle.pop(i)
    array = np.empty(size + LINE, np.uint8)
    first = -array.ctypes.data % LINE
    return array[first:first + size]

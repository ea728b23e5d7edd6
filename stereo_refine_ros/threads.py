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
Bands of rows on a few threads, for kernels that release the interpreter lock.

Numba's own thread layers spin after a loop or refuse concurrent callers, and OpenCV keeps a
pool of its own; one small pool here keeps two cores from being fought over, and a band's result
does not depend on how many bands there are.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from functools import lru_cache
from typing import Any


@lru_cache(maxsize=None)
def _pool(workers: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(workers, thread_name_prefix='stereo_refine')


def run_bands(kernel: Callable[..., Any], size: int, threads: int, *args: Any) -> None:
    """Call `kernel(start, stop, *args)` for `threads` bands that cover range(size)."""
    bands = max(1, min(threads, size))
    bounds = [size * i // bands for i in range(bands + 1)]
    others = [_pool(bands - 1).submit(kernel, bounds[i], bounds[i + 1], *args)
              for i in range(1, bands)] if bands > 1 else []
    kernel(bounds[0], bounds[1], *args)
    for other in others:
        other.result()


def start(threads: int, task: Callable[..., Any], *args: Any) -> Future[Any]:
    """Run a task beside the caller where there are two threads or more, else at once."""
    if threads > 1:
        return _pool(threads - 1).submit(task, *args)
    done: Future[Any] = Future()
    done.set_result(task(*args))
    return done

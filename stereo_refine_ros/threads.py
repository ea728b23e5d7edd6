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
pool of its own; one small pool here keeps two cores from being fought over. Bands are taken by
whoever is free, and a band's result does not depend on who took it.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache, partial
from itertools import count
from typing import Any, Generic, TypeVar

Result = TypeVar('Result')

_BANDS_PER_THREAD = 2


@lru_cache(maxsize=None)
def _pool(workers: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(workers, thread_name_prefix='stereo_refine')


def run_bands(kernel: Callable[..., Any], size: int, threads: int, *args: Any) -> None:
    """Call `kernel(start, stop, *args)` for bands that cover range(size), on free threads."""
    if threads == 1 or size < 2:
        kernel(0, size, *args)
        return
    run_parts(kernel, size, min(size, threads * _BANDS_PER_THREAD), threads, *args)


def run_parts(kernel: Callable[..., Any], size: int, parts: int, threads: int, *args: Any) -> None:
    """Call `kernel(start, stop, *args)` for so many parts of range(size), on free threads."""
    bounds = [size * i // parts for i in range(parts + 1)]
    taken = count()

    def work() -> None:
        while (part := next(taken)) < parts:
            kernel(bounds[part], bounds[part + 1], *args)

    helpers = [_pool(threads - 1).submit(work) for _ in range(min(threads, parts) - 1)]
    work()
    # A helper that has not begun is busy elsewhere, and nothing is left for it.
    for helper in helpers:
        if not helper.cancel():
            helper.result()


class Task(Generic[Result]):
    """A call that runs beside the caller, or by whoever wants its result before it has begun."""

    def __init__(self, threads: int, call: Callable[[], Result]) -> None:
        self._call = call
        self._future = _pool(threads - 1).submit(call) if threads > 1 else None

    def result(self) -> Result:
        """Return what the call returned; raises what it raised."""
        if self._future is None or self._future.cancel():
            return self._call()
        return self._future.result()


def start(threads: int, task: Callable[..., Result], *args: Any) -> Task[Result]:
    """Run a task beside the caller where there are two threads or more."""
    return Task(threads, partial(task, *args))

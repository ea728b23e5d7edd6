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

"""Two threads: one takes the newest frame, one makes what is owed for a frame already out."""

from __future__ import annotations

from collections.abc import Callable
import queue
import threading
from typing import Generic, TypeVar

Item = TypeVar('Item')


class NewestSlot(Generic[Item]):
    """Hold one item between two threads; a newer one replaces it."""

    def __init__(self) -> None:
        """Start empty and open."""
        self._condition = threading.Condition()
        self._item: Item | None = None
        self._closed = False

    def put(self, item: Item) -> Item | None:
        """Leave an item; return the one that it replaced."""
        with self._condition:
            replaced, self._item = self._item, item
            self._condition.notify()
        return replaced

    def take(self) -> Item | None:
        """Wait for an item; None once the slot is closed."""
        with self._condition:
            self._condition.wait_for(lambda: self._item is not None or self._closed)
            item, self._item = self._item, None
            return None if self._closed else item

    def close(self) -> None:
        """Let `take` return None from now on."""
        with self._condition:
            self._closed = True
            self._condition.notify_all()


class Worker(Generic[Item]):
    """
    Process the newest item at a time in a thread of its own.

    Parameters
    ----------
    prepare : callable
        Runs once in the thread before the first item.
    process : callable of one item
    on_error : callable of an exception
        Told what `prepare` or `process` raised; the thread goes on with the next item.

    """

    def __init__(self, prepare: Callable[[], None], process: Callable[[Item], None],
                 on_error: Callable[[Exception], None]) -> None:
        """Keep the callables; `start` starts the thread."""
        self._prepare = prepare
        self._process = process
        self._on_error = on_error
        self._slot: NewestSlot[Item] = NewestSlot()
        # A daemon: a kernel that runs for seconds must not hold up the end of the process.
        self._thread = threading.Thread(target=self._run, name='refine', daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def submit(self, item: Item) -> Item | None:
        """Hand over the newest item; return the one that it replaced, if any."""
        return self._slot.put(item)

    def stop(self, timeout_s: float) -> bool:
        """Ask the thread to end; return whether it did within the time."""
        self._slot.close()
        if self._thread.is_alive():
            self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _run(self) -> None:
        self._guarded(self._prepare)
        while (item := self._slot.take()) is not None:
            self._guarded(self._process, item)

    def _guarded(self, task: Callable[..., None], *args: Item) -> None:
        try:
            task(*args)
        except Exception as error:  # whatever a frame does, the next one gets its chance
            self._on_error(error)


class Afterwork:
    """
    Do tasks in order in a thread of its own, at most one of them waiting.

    Views and metrics of a frame are made here while the next frame is being refined; a worker
    that is faster than this waits, so that every frame gets its own.

    Parameters
    ----------
    on_error : callable of an exception
        Told what a task raised; the thread goes on with the next one.

    """

    def __init__(self, on_error: Callable[[Exception], None]) -> None:
        """Start the thread."""
        self._on_error = on_error
        self._tasks: queue.Queue[Callable[[], None]] = queue.Queue(maxsize=1)
        threading.Thread(target=self._run, name='afterwork', daemon=True).start()

    def submit(self, task: Callable[[], None]) -> None:
        """Leave a task; wait while another one is waiting."""
        self._tasks.put(task)

    def _run(self) -> None:
        while True:
            try:
                self._tasks.get()()
            except Exception as error:
                self._on_error(error)

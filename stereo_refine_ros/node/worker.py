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

"""Newest frames refined a few at a time and delivered in order; what is owed for them after."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
import queue
import threading
import time
from typing import Generic, TypeVar

Item = TypeVar('Item')
Result = TypeVar('Result')

MOST_IN_FLIGHT = 2


class NewestSlot(Generic[Item]):
    """Hold one item between threads; a newer one replaces it."""

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


class Worker(Generic[Item, Result]):
    """
    Refine the newest items, a few at a time, and deliver the results in order of arrival.

    One loop begins an item as soon as there is room, and leaves its future in a FIFO; another
    takes the futures out and waits for each in turn.

    Parameters
    ----------
    prepare : callable
        Runs once in a thread before the first item.
    refine : callable of an item and a bool
        Makes the result; told whether no other item was in work when this one began.
    deliver : callable of a result
    on_error : callable of an exception
        Told what any of the three raised; the next item gets its chance.
    limit : callable
        Returns how many items may be in work, up to MOST_IN_FLIGHT; asked before an item is
        waited for, so a change shows from the next one on.

    """

    def __init__(self, prepare: Callable[[], None], refine: Callable[[Item, bool], Result],
                 deliver: Callable[[Result], None], on_error: Callable[[Exception], None],
                 limit: Callable[[], int] = lambda: 1) -> None:
        """Keep the callables; `start` starts the threads."""
        self._prepare = prepare
        self._refine = refine
        self._deliver = deliver
        self._on_error = on_error
        self._limit = limit
        self._slot: NewestSlot[Item] = NewestSlot()
        self._begun: queue.SimpleQueue[Future[Result] | None] = queue.SimpleQueue()
        self._room = threading.Condition()
        self._in_work = 0
        self._closed = False
        # Daemons: a kernel that runs for seconds must not hold up the end of the process.
        self._threads = [
            threading.Thread(target=task, name=task.__name__, daemon=True)
            for task in (self._begin_items, self._deliver_results)]

    def start(self) -> None:
        """Start the threads."""
        for thread in self._threads:
            thread.start()

    def submit(self, item: Item) -> Item | None:
        """Hand over the newest item; return the one that it replaced, if any."""
        return self._slot.put(item)

    def stop(self, timeout_s: float) -> bool:
        """Ask the threads to end; return whether they did within the time."""
        with self._room:
            self._closed = True
            self._room.notify_all()
        self._slot.close()
        end = time.monotonic() + timeout_s
        for thread in self._threads:
            if thread.is_alive():
                thread.join(max(0.0, end - time.monotonic()))
        return not any(thread.is_alive() for thread in self._threads)

    def _begin_items(self) -> None:
        try:
            self._prepare()
        except Exception as error:
            self._on_error(error)
        with ThreadPoolExecutor(MOST_IN_FLIGHT, 'refine') as pool:
            while self._wait_for_room() and (item := self._slot.take()) is not None:
                with self._room:
                    is_alone = self._in_work == 0
                    self._in_work += 1
                self._begun.put(pool.submit(self._refine, item, is_alone))
        self._begun.put(None)

    def _wait_for_room(self) -> bool:
        with self._room:
            self._room.wait_for(lambda: self._closed or self._in_work < self._limit())
            return not self._closed

    def _deliver_results(self) -> None:
        while (future := self._begun.get()) is not None:
            try:
                self._deliver(future.result())
            except Exception as error:  # whatever a frame does, the next one gets its chance
                self._on_error(error)
            finally:
                with self._room:
                    self._in_work -= 1
                    self._room.notify_all()


class Afterwork:
    """
    Do tasks in order in a thread of its own, at most one of them waiting.

    Views of a frame are made here while the next frame is being refined; a worker that is
    faster than this waits, so that every frame gets its own.

    Parameters
    ----------
    on_error : callable of an exception
        Told what a task raised; the thread goes on with the next one.

    """

    def __init__(self, on_error: Callable[[Exception], None]) -> None:
        """Start the thread."""
        self._on_error = on_error
        self._tasks: queue.Queue[Callable[[], None] | None] = queue.Queue(maxsize=1)
        self._thread = threading.Thread(target=self._run, name='afterwork', daemon=True)
        self._thread.start()

    def submit(self, task: Callable[[], None]) -> None:
        """Leave a task; wait while another one is waiting."""
        self._tasks.put(task)

    def stop(self, timeout_s: float) -> bool:
        """Do what is waiting, then end; return whether that was within the time."""
        end = time.monotonic() + timeout_s
        try:
            self._tasks.put(None, timeout=timeout_s)
        except queue.Full:
            return False
        self._thread.join(max(0.0, end - time.monotonic()))
        return not self._thread.is_alive()

    def _run(self) -> None:
        while (task := self._tasks.get()) is not None:
            try:
                task()
            except Exception as error:
                self._on_error(error)

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

"""Threads that take the newest frames, and one that makes what is owed for a frame already out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import queue
import threading
import time
from typing import Generic, TypeVar

Item = TypeVar('Item')

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


@dataclass(frozen=True)
class Turn:
    """
    The place of an item in the order of arrival.

    Attributes
    ----------
    is_alone : bool
        Whether no other item was being processed when this one was begun.
    wait : callable
        Returns once every item before this one is done.

    """

    is_alone: bool = True
    wait: Callable[[], None] = lambda: None


FIRST = Turn()


class _Order:
    """Tickets in the order of arrival, and how many of them are out."""

    def __init__(self) -> None:
        self._condition = threading.Condition()
        self._drawn = 0
        self._serving = 0
        self._finished: set[int] = set()
        self._closed = False

    def room(self, limit: Callable[[], int]) -> None:
        """Wait until fewer than `limit` items are being processed."""
        with self._condition:
            self._condition.wait_for(lambda: self._closed or self._active() < limit())

    def draw(self) -> tuple[int, Turn]:
        with self._condition:
            ticket, self._drawn = self._drawn, self._drawn + 1
            return ticket, Turn(self._active() == 1, lambda: self._wait(ticket))

    def finish(self, ticket: int) -> None:
        with self._condition:
            self._finished.add(ticket)
            while self._serving in self._finished:
                self._finished.remove(self._serving)
                self._serving += 1
            self._condition.notify_all()

    def close(self) -> None:
        with self._condition:
            self._closed = True
            self._condition.notify_all()

    def _active(self) -> int:
        return self._drawn - self._serving - len(self._finished)

    def _wait(self, ticket: int) -> None:
        with self._condition:
            self._condition.wait_for(lambda: self._serving == ticket)


class Worker(Generic[Item]):
    """
    Process the newest items, a few at a time, in threads of its own.

    While one item leaves a core idle, the next one may begin; `Turn.wait` lets them end in the
    order in which they came.

    Parameters
    ----------
    prepare : callable
        Runs once in a thread before the first item.
    process : callable of one item and its Turn
    on_error : callable of an exception
        Told what `prepare` or `process` raised; the thread goes on with the next item.
    limit : callable
        Returns how many items may be processed at a time, up to MOST_IN_FLIGHT; asked before an
        item is waited for, so a change shows from the next one on.

    """

    def __init__(self, prepare: Callable[[], None], process: Callable[[Item, Turn], None],
                 on_error: Callable[[Exception], None],
                 limit: Callable[[], int] = lambda: 1) -> None:
        """Keep the callables; `start` starts the threads."""
        self._prepare = prepare
        self._process = process
        self._on_error = on_error
        self._limit = limit
        self._slot: NewestSlot[Item] = NewestSlot()
        self._order = _Order()
        self._taking = threading.Lock()
        # Daemons: a kernel that runs for seconds must not hold up the end of the process.
        self._threads = [
            threading.Thread(target=self._run, name='refine', args=(number,), daemon=True)
            for number in range(MOST_IN_FLIGHT)]
        self._prepared = threading.Event()

    def start(self) -> None:
        """Start the threads."""
        for thread in self._threads:
            thread.start()

    def submit(self, item: Item) -> Item | None:
        """Hand over the newest item; return the one that it replaced, if any."""
        return self._slot.put(item)

    def stop(self, timeout_s: float) -> bool:
        """Ask the threads to end; return whether they did within the time."""
        self._slot.close()
        self._order.close()
        end = time.monotonic() + timeout_s
        for thread in self._threads:
            if thread.is_alive():
                thread.join(max(0.0, end - time.monotonic()))
        return not any(thread.is_alive() for thread in self._threads)

    def _run(self, number: int) -> None:
        if number == 0:
            try:
                self._guarded(self._prepare)
            finally:
                self._prepared.set()
        self._prepared.wait()
        while (taken := self._take()) is not None:
            item, ticket, turn = taken
            try:
                self._guarded(self._process, item, turn)
            finally:  # even where `on_error` raises: the other thread waits for this
                self._order.finish(ticket)

    def _take(self) -> tuple[Item, int, Turn] | None:
        """Wait for room and for an item, one thread at a time, so that tickets keep the order."""
        with self._taking:
            self._order.room(self._limit)
            item = self._slot.take()
            return None if item is None else (item, *self._order.draw())

    def _guarded(self, task: Callable[..., None], *args: object) -> None:
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

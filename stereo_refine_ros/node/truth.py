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

"""Frames and their ground truth, whichever comes first: the disparity never waits for it."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
import threading
import time
from typing import Generic, TypeVar

from stereo_msgs.msg import DisparityImage

Frame = TypeVar('Frame')

WAIT_S = 1.0
MOST_WAITING = 8  # frames; beyond, the oldest goes on without its truth
_KEPT = 32  # truths without a frame


class TruthDesk(Generic[Frame]):
    """
    Measure frames in order, in a thread of its own, each with its ground truth if that comes.

    A frame waits up to `WAIT_S`, and only while somebody publishes ground truth. A caller that
    is faster than the measuring itself waits, so that every frame is measured.

    Parameters
    ----------
    measure : callable of a frame and a DisparityImage or None
    is_expected : callable
        Returns whether somebody publishes ground truth now.
    on_error : callable of an exception
        Told what `measure` raised.

    """

    def __init__(self, measure: Callable[[Frame, DisparityImage | None], None],
                 is_expected: Callable[[], bool], on_error: Callable[[Exception], None]) -> None:
        """Start the thread."""
        self._measure = measure
        self._is_expected = is_expected
        self._on_error = on_error
        self._change = threading.Condition()
        self._frames: deque[tuple[int, Frame, float]] = deque()
        self._truths: dict[int, DisparityImage] = {}
        self._closed = False
        self._thread = threading.Thread(target=self._run, name='truth', daemon=True)
        self._thread.start()

    def stop(self, timeout_s: float) -> bool:
        """Measure no more frames; return whether the thread ended within the time."""
        with self._change:
            self._closed = True
            self._change.notify_all()
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def add_truth(self, stamp_ns: int, message: DisparityImage) -> None:
        """Keep a truth for the frame of its stamp."""
        with self._change:
            self._truths.pop(stamp_ns, None)
            self._truths[stamp_ns] = message
            for old in list(self._truths)[:-_KEPT]:
                del self._truths[old]
            self._change.notify_all()

    def add_frame(self, stamp_ns: int, frame: Frame) -> None:
        """Leave a frame to be measured."""
        with self._change:
            self._change.wait_for(
                lambda: self._closed or len(self._frames) < 2 * MOST_WAITING)
            self._frames.append((stamp_ns, frame, time.monotonic() + WAIT_S))
            self._change.notify_all()

    def _run(self) -> None:
        while (found := self._next()) is not None:
            try:
                self._measure(*found)
            except Exception as error:
                self._on_error(error)

    def _next(self) -> tuple[Frame, DisparityImage | None] | None:
        """Wait until the oldest frame has its truth, or need not wait for it any longer."""
        with self._change:
            self._change.wait_for(lambda: self._closed or self._frames)
            if self._closed:
                return None
            stamp_ns, frame, deadline = self._frames[0]
            while not (self._closed or stamp_ns in self._truths or len(self._frames) > MOST_WAITING
                       or time.monotonic() >= deadline or not self._is_expected()):
                self._change.wait(deadline - time.monotonic())
            self._frames.popleft()
            self._change.notify_all()
            return frame, self._truths.pop(stamp_ns, None)

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

"""The row offset of one camera over its frames: settled, and still able to follow a knock."""

from __future__ import annotations

from collections import deque

import numpy as np

from stereo_refine_ros.rectification import tuning
from stereo_refine_ros.rectification.row_offset import NO_OFFSET, RowOffset, significant


class RowOffsetTracker:
    """
    Average what single frames say, and keep still while it does not change.

    Each frame's own measurement differs a little from the last one's; warping by it would make
    a still picture move. So the offset in use changes only where the average has left it, or
    where several frames in a row say that the camera has been knocked. Frames without evidence
    change nothing.
    """

    def __init__(self) -> None:
        """Start without knowledge: the first frame with evidence decides."""
        self._measured: deque[RowOffset] = deque(maxlen=tuning.FRAMES_AVERAGED)
        self._in_use = NO_OFFSET

    @property
    def in_use(self) -> RowOffset:
        """Return the offset to undo, as the last update left it."""
        return self._in_use

    @property
    def has_evidence(self) -> bool:
        """Whether any frame said anything yet."""
        return bool(self._measured)

    @property
    def wants_more(self) -> bool:
        """Whether the average rests on too few frames yet, or on frames that disagree."""
        latest = list(self._measured)
        return len(latest) < tuning.FRAMES_AVERAGED or (
            _distance(latest[-1], _median(latest)) >= tuning.KNOCK_PX)

    def update(self, measured: RowOffset) -> RowOffset:
        """
        Take in one frame's `measure_row_offset`; return the offset to undo.

        Parameters
        ----------
        measured : RowOffset
            However small; with `points` 0 it says nothing.

        """
        if measured.points == 0:
            return self._in_use
        self._measured.append(measured)
        self._forget_before_knock()
        average = _median(list(self._measured))
        if _distance(average, self._in_use) > tuning.KEEP_PX or self._in_use.is_zero:
            # What is in use stays so down to a smaller offset than it takes to begin.
            least = tuning.LEAST_PX if self._in_use.is_zero else tuning.KEEP_PX
            self._in_use = significant(average, least)
        return self._in_use

    def _forget_before_knock(self) -> None:
        """Drop what is older than the last few frames, where these agree on another offset."""
        latest = list(self._measured)[-tuning.FRAMES_TO_FOLLOW:]
        earlier = list(self._measured)[:-tuning.FRAMES_TO_FOLLOW]
        if len(earlier) == 0:
            return
        here, before = _median(latest), _median(earlier)
        is_steady = all(_distance(offset, here) < tuning.KNOCK_PX for offset in latest)
        if is_steady and _distance(here, before) >= tuning.KNOCK_PX:
            self._measured = deque(latest, maxlen=tuning.FRAMES_AVERAGED)


def _median(offsets: list[RowOffset]) -> RowOffset:
    terms = np.median([offset.terms for offset in offsets], axis=0)
    return RowOffset.of(terms, offsets[-1].points)


def _distance(first: RowOffset, second: RowOffset) -> float:
    """Return by how much two offsets differ at most in the image, pixels."""
    return RowOffset.of(np.subtract(first.terms, second.terms), 0).largest_px

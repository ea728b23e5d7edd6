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

"""What takes longer to find out than a frame has: asked bit by bit, once in a while."""

from __future__ import annotations

import math
import threading
import time

from stereo_refine_ros.health.external import fits_right_better
from stereo_refine_ros.health.suspicion import CoarseLook, look_at, LOOKS
from stereo_refine_ros.health.tuning import LOOK_EVERY_S
from stereo_refine_ros.params import MatchingParams
from stereo_refine_ros.types import FloatMap, Image, StereoPair

# What `look_at` takes: the look, both views in grey, the range of disparities.
_Question = tuple[str, Image, Image, int, int]


class LongLook:
    """
    Look at a pair coarsely, and at a map from outside, once in LOOK_EVERY_S seconds.

    The first pair is asked everything at once. Later one question goes with every frame, so that
    none is late for it, and all of a look are asked of the pair that began it: answers of several
    pairs, black and healthy ones, would contradict each other. Frames may come from several
    threads.
    """

    def __init__(self) -> None:
        """Start without knowledge."""
        self._lock = threading.Lock()
        self._begun_at = self._map_seen_at = -math.inf
        self._open: list[_Question] = []
        self._answers: dict[str, float] = {}
        self._fits_right = False
        self.latest = CoarseLook(math.nan, math.nan, math.nan, math.nan)

    def ask(self, pair: StereoPair, matching: MatchingParams) -> None:
        """Ask what is due, of this pair where a look begins; the last answer changes `latest`."""
        for question in self._due(pair, matching):
            answer = look_at(*question)
            with self._lock:
                self._answers[question[0]] = answer
                if not self._open and len(self._answers) == len(LOOKS):
                    self.latest = CoarseLook(**self._answers)

    def _due(self, pair: StereoPair, matching: MatchingParams) -> list[_Question]:
        with self._lock:
            is_first = math.isinf(self._begun_at)
            now = time.monotonic()
            if not self._open and now - self._begun_at >= LOOK_EVERY_S:
                self._begun_at = now
                self._open = [(look, pair.left_grey, pair.right_grey, matching.min_disparity,
                               matching.num_disparities) for look in LOOKS]
            number = len(self._open) if is_first else 1
            due, self._open = self._open[:number], self._open[number:]
            return due

    def fits_right(self, given: FloatMap, pair: StereoPair) -> bool:
        """Tell whether a map from outside was last seen to be one of the right view."""
        with self._lock:
            now = time.monotonic()
            if now - self._map_seen_at < LOOK_EVERY_S:
                return self._fits_right
            self._map_seen_at = now
        found = given.shape == pair.shape and fits_right_better(
            given, pair.left_grey, pair.right_grey)
        with self._lock:
            self._fits_right = found
        return found

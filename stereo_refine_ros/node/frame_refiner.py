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

"""The core as the node uses it: rebuilt when parameters change, its fallback where it fails."""

from __future__ import annotations

from collections.abc import Callable
import threading

from stereo_refine_ros.params import Params
from stereo_refine_ros.pipeline import StereoRefiner
from stereo_refine_ros.types import FloatMap, RefinementResult, StereoPair

FAILURES_BEFORE_FALLBACK = 3


class FrameRefiner:
    """
    Refine frames with one `StereoRefiner` for as long as the parameters stay.

    A refinement that raises costs its frame; after `FAILURES_BEFORE_FALLBACK` in a row the
    preliminary disparity stands in, until refining works again.

    Parameters
    ----------
    make_refiner : callable of Params

    """

    def __init__(self, make_refiner: Callable[[Params], StereoRefiner] = StereoRefiner) -> None:
        """Build nothing yet."""
        self._make_refiner = make_refiner
        self._refiner: StereoRefiner | None = None
        self._failures = 0
        self._lock = threading.Lock()

    def refine(self, pair: StereoPair, preliminary: FloatMap | None, params: Params,
               threads: int) -> tuple[RefinementResult, Exception | None]:
        """
        Return the refined frame, or its preliminary disparity and the failure behind it.

        Raises
        ------
        Exception
            Whatever the refinement raised, where it has not failed often enough.

        """
        refiner = self._refiner_for(params)
        frame = (pair.left, pair.right, preliminary, threads)
        try:
            result = refiner.process(*frame)
        except Exception as error:
            if self._count_failure() < FAILURES_BEFORE_FALLBACK:
                raise
            return refiner.preliminary_only(*frame), error
        self._failures = 0
        return result, None

    def _refiner_for(self, params: Params) -> StereoRefiner:
        with self._lock:
            if self._refiner is None or self._refiner.params != params:
                refiner = self._make_refiner(params)
                if self._refiner is not None:
                    refiner.follow(self._refiner)
                self._refiner = refiner
            return self._refiner

    def _count_failure(self) -> int:
        with self._lock:
            self._failures += 1
            return self._failures

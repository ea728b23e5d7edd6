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

"""What is wrong with the cameras, and undone: examined pair by pair, beside the method."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass, replace
import math
import threading
import time

import numpy as np

from stereo_refine_ros.health.clearing import clear_pair
from stereo_refine_ros.health.external import fits_right_better, given_agreement
from stereo_refine_ros.health.suspicion import CoarseLook, suspect
from stereo_refine_ros.health.tuning import LOOK_EVERY_PAIRS, LOOK_EVERY_S
from stereo_refine_ros.health.views import measure_views
from stereo_refine_ros.params import MatchingParams, Params
from stereo_refine_ros.rectification import (
    measure_row_offset, RowOffset, RowOffsetTracker, significant, undo_row_offset)
from stereo_refine_ros.types import FloatMap, PairHealth, StereoPair


@dataclass(frozen=True, eq=False)
class Prepared:
    """
    A pair ready to be matched.

    Attributes
    ----------
    pair : StereoPair
        Its row offset undone; grey and clearer where noise was heavy.
    offset : RowOffset
        That was found.
    views : PairHealth
        What the two images say by themselves.

    """

    pair: StereoPair
    offset: RowOffset
    views: PairHealth


class PairExaminer:
    """
    Find the row offset of a pair and undo it; say how healthy the pair is.

    With `temporal.enabled` the offset settles over the pairs that one examiner has seen. Pairs
    may come from several threads. What takes longer than a frame has is looked at once in
    LOOK_EVERY_S seconds; it changes no disparity.
    """

    def __init__(self, params: Params) -> None:
        """Start without knowledge of the cameras."""
        self._params = params
        self._tracker = RowOffsetTracker()
        self._pairs = 0
        self._views = PairHealth()
        self._lock = threading.Lock()
        self._looked_at = -LOOK_EVERY_S
        self._look = CoarseLook(math.nan, math.nan, math.nan, math.nan)
        self._fits_right = False

    def follow(self, other: PairExaminer) -> None:
        """Take over what another examiner knows of the cameras, as far as it holds here."""
        mine, theirs = self._params, other._params
        with other._lock:
            if (mine.matching, mine.rectification, mine.temporal) == (
                    theirs.matching, theirs.rectification, theirs.temporal):
                self._tracker, self._pairs = deepcopy(other._tracker), other._pairs
                self._views = other._views
            # Parameters that change with every frame must not ask for a look at every frame.
            self._looked_at, self._look = other._looked_at, other._look
            self._fits_right = other._fits_right

    def prepare(self, pair: StereoPair, threads: int) -> Prepared:
        """Undo the row offset of a pair, and clear it of noise; say what was found."""
        if pair.right is None:
            return Prepared(pair, RowOffset(), PairHealth())
        offset, views = self._measured(pair)
        if self._params.rectification.correct and not offset.is_zero:
            pair = pair.with_right(undo_row_offset(pair.right, offset, threads))
        return Prepared(clear_pair(pair, views), offset, views)

    def _measured(self, pair: StereoPair) -> tuple[RowOffset, PairHealth]:
        """Measure a pair, or take what has settled over the last ones."""
        if not self._params.temporal.enabled:
            return significant(self._row_offset(pair)), self._measure_views(pair)
        with self._lock:
            self._pairs += 1
            if not self._tracker.wants_more and self._pairs % LOOK_EVERY_PAIRS:
                return self._tracker.in_use, self._views
        measured, views = self._row_offset(pair), self._measure_views(pair)
        with self._lock:
            self._views = views
            return self._tracker.update(measured), views

    def _row_offset(self, pair: StereoPair) -> RowOffset:
        matching = self._params.matching
        return measure_row_offset(pair.left_grey, pair.right_grey, matching.min_disparity,
                                  matching.num_disparities)

    def _measure_views(self, pair: StereoPair) -> PairHealth:
        return measure_views(pair.left_grey, pair.right_grey)

    def examine(self, prepared: Prepared, fine: FloatMap, given: FloatMap | None) -> PairHealth:
        """
        Measure what the images and their own match say.

        Parameters
        ----------
        prepared : Prepared
            The pair, and what `prepare` found.
        fine : float32 ndarray of shape (H, W)
            The own match, NaN where left and right disagree; on any grid.
        given : float32 ndarray of shape (H, W), or None
            A map from outside, on the same grid.

        """
        pair = prepared.pair
        if pair.right is None:
            return PairHealth()
        look, fits_right = self._coarse_look(pair, given)
        matching = self._params.matching
        offset = prepared.offset
        return replace(
            prepared.views, row_offset_px=offset.largest_px if offset.points else math.nan,
            nearer_ratio=look.nearer,
            matched_ratio=look.as_is, upside_down_ratio=look.upside_down,
            swapped_ratio=look.swapped, last_disparity_ratio=_at_the_end(fine, matching),
            fits_right_better=fits_right,
            given_agreement=math.nan if given is None else given_agreement(given, fine))

    def _coarse_look(self, pair: StereoPair, given: FloatMap | None,
                     ) -> tuple[CoarseLook, bool]:
        with self._lock:
            now = time.monotonic()
            if now - self._looked_at < LOOK_EVERY_S:
                return self._look, self._fits_right
            self._looked_at = now
        matching = self._params.matching
        left, right = pair.left_grey, pair.right_grey
        look = suspect(left, right, matching.min_disparity, matching.num_disparities)
        fits_right = (given is not None and given.shape == left.shape
                      and fits_right_better(given, left, right))
        with self._lock:
            self._look, self._fits_right = look, fits_right
        return look, fits_right


def _at_the_end(fine: FloatMap, matching: MatchingParams) -> float:
    """Share of the matches that lie at the last disparities of the range."""
    matched = np.count_nonzero(np.isfinite(fine))
    last = matching.min_disparity + matching.num_disparities - 2
    return float(np.count_nonzero(fine >= last)) / matched if matched else math.nan

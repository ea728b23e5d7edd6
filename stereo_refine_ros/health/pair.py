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

import numpy as np

from stereo_refine_ros.health.clearing import clear_pair
from stereo_refine_ros.health.exposure import even_exposure
from stereo_refine_ros.health.external import given_agreement
from stereo_refine_ros.health.long_look import LongLook
from stereo_refine_ros.health.tuning import LOOK_EVERY_PAIRS
from stereo_refine_ros.health.views import measure_views
from stereo_refine_ros.params import MatchingParams, Params
from stereo_refine_ros.rectification import (
    measure_row_offset, RowOffset, RowOffsetTracker, significant, undo_row_offset)
from stereo_refine_ros.threads import start, Task
from stereo_refine_ros.types import FloatMap, PairHealth, StereoPair

Measured = tuple[RowOffset, PairHealth]


@dataclass(frozen=True, eq=False)
class Prepared:
    """
    A pair ready to be matched.

    Attributes
    ----------
    pair : StereoPair
        Its row offset undone, its exposures made alike; grey and clearer where noise was heavy.
    offset : RowOffset
        That was found.
    views : PairHealth
        What the two images say by themselves.
    seeing : Task of (RowOffset, PairHealth) or None, optional
        Both of this pair, where they are still being measured: for the next ones.

    """

    pair: StereoPair
    offset: RowOffset
    views: PairHealth
    seeing: Task[Measured | None] | None = None


class PairExaminer:
    """
    Find the row offset of a pair and undo it; say how healthy the pair is.

    With `temporal.enabled` the offset settles over the pairs that one examiner has seen, and once
    there is one, a pair is measured beside its matching, for the next ones. Pairs may come from
    several threads. What takes longer than a frame has, a `LongLook` asks bit by bit; it changes
    no disparity.
    """

    def __init__(self, params: Params) -> None:
        """Start without knowledge of the cameras."""
        self._params = params
        self._tracker = RowOffsetTracker()
        self._pairs = 0
        self._views = PairHealth()
        self._lock = threading.Lock()
        self._long_look = LongLook()

    def follow(self, other: PairExaminer) -> None:
        """Take over what another examiner knows of the cameras, as far as it holds here."""
        mine, theirs = self._params, other._params
        with other._lock:
            if (mine.matching, mine.rectification, mine.temporal) == (
                    theirs.matching, theirs.rectification, theirs.temporal):
                self._tracker, self._pairs = deepcopy(other._tracker), other._pairs
                self._views = other._views
            # Parameters that change with every frame must not ask for a look at every frame.
            self._long_look = other._long_look

    def prepare(self, pair: StereoPair, threads: int) -> Prepared:
        """Undo row offset, unlike exposures and noise of a pair; say what was found."""
        if pair.right is None:
            return Prepared(pair, RowOffset(), PairHealth())
        (offset, views), is_due = self._known(pair)
        as_it_came = pair if is_due else None
        if self._params.rectification.correct and not offset.is_zero:
            pair = pair.with_right(undo_row_offset(pair.right, offset, threads))
        pair = clear_pair(even_exposure(pair), views)
        return Prepared(pair, offset, views, start(threads, self._see, pair, as_it_came))

    def _known(self, pair: StereoPair) -> tuple[Measured, bool]:
        """Take what has settled over the last pairs, and whether this one is to be measured."""
        if not self._params.temporal.enabled:
            offset, views = self._measure(pair)
            return (significant(offset), views), False
        with self._lock:
            self._pairs += 1
            is_due = self._tracker.wants_more or self._pairs % LOOK_EVERY_PAIRS == 0
            if self._tracker.has_evidence:
                return (self._tracker.in_use, self._views), is_due
        return self._learn(*self._measure(pair)), False

    def _see(self, pair: StereoPair, as_it_came: StereoPair | None) -> Measured | None:
        """Find out, beside the matching, what this frame does not wait for."""
        self._long_look.ask(pair, self._params.matching)
        return None if as_it_came is None else self._measure(as_it_came)

    def _measure(self, pair: StereoPair) -> Measured:
        matching = self._params.matching
        views = pair.left_grey, pair.right_grey
        return (measure_row_offset(*views, matching.min_disparity, matching.num_disparities),
                measure_views(*views))

    def _learn(self, offset: RowOffset, views: PairHealth) -> Measured:
        """Take in what was measured of a pair; return what holds now."""
        with self._lock:
            self._views = views
            return self._tracker.update(offset), views

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
        views, offset = prepared.views, prepared.offset
        measured = prepared.seeing.result() if prepared.seeing else None
        if measured is not None:
            views = self._learn(*measured)[1]
        look, matching = self._long_look.latest, self._params.matching
        return replace(
            views, row_offset_px=offset.largest_px if offset.points else math.nan,
            nearer_ratio=look.nearer,
            matched_ratio=look.as_is, upside_down_ratio=look.upside_down,
            swapped_ratio=look.swapped, last_disparity_ratio=_at_the_end(fine, matching),
            fits_right_better=given is not None and self._long_look.fits_right(given, pair),
            given_agreement=math.nan if given is None else given_agreement(given, fine))


def _at_the_end(fine: FloatMap, matching: MatchingParams) -> float:
    """Share of the matches that lie at the last disparities of the range."""
    matched = np.count_nonzero(np.isfinite(fine))
    last = matching.min_disparity + matching.num_disparities - 2
    return float(np.count_nonzero(fine >= last)) / matched if matched else math.nan

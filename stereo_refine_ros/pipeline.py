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

"""The whole method on one screen: match, segment, fit planes, project, filter."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
import time

import numpy as np

from stereo_refine_ros.graph.segment_graph import build_segment_graph, SegmentGraph
from stereo_refine_ros.matching import compute_match, OPENCV_MATCHERS
from stereo_refine_ros.matching.evidence import Evidence
from stereo_refine_ros.matching.match import Match
from stereo_refine_ros.matching.scanline import gather_evidence
from stereo_refine_ros.params import Params
from stereo_refine_ros.refinement.filling import fill_from_background
from stereo_refine_ros.refinement.filters import apply_filter
from stereo_refine_ros.refinement.plane_stage import unfitted, apply_planes, put_on_planes
from stereo_refine_ros.refinement.row_binning import (
    bin_disparities, bin_rows, keep_agreeing, repeat_rows, restore_rows, rows_per_bin)
from stereo_refine_ros.refinement.trust import find_overruled, follows_edges, take_back
from stereo_refine_ros.threads import start
from stereo_refine_ros.types import (
    DisparityMap, FloatMap, Image, PairHealth, PlaneSegmentation, RefinementResult, StereoPair)


class StereoRefiner:
    """
    Refine the disparity of one stereo pair after another (Hamzah et al. 2017, figure 2).

    Parameters
    ----------
    params : Params
        From `load_preset`. Build a new refiner to change them.

    """

    def __init__(self, params: Params) -> None:
        """Keep the parameters; nothing is computed yet."""
        self.params = params

    def process(self, left: Image, right: Image | None, preliminary: FloatMap | None = None,
                threads: int | None = None) -> RefinementResult:
        """
        Compute the preliminary disparity of a rectified pair and refine it.

        Parameters
        ----------
        left, right : uint8 ndarray of shape (H, W) or (H, W, 3) BGR
            `right` may be None when `preliminary` is given.
        preliminary : float32 ndarray of shape (H, W), optional
            Disparity of the left view in pixels, NaN invalid; replaces the matcher.
        threads : int, optional
            Instead of `processing.threads`; the result does not depend on it.

        Raises
        ------
        ValueError
            For images or a map of the wrong type or shape.

        """
        begin = time.perf_counter()
        pair = StereoPair(left, right)
        if preliminary is not None:
            preliminary = _checked(preliminary, pair.shape)
        matching, threads = self.params.matching, threads or self.params.processing.threads
        rows = rows_per_bin(pair.shape, matching.num_disparities, self.params.processing)
        # A map that comes at full size is refined on averaged rows, and keeps its own detail.
        is_whole = rows > 1 and (
            preliminary is not None or matching.method in OPENCV_MATCHERS)
        stage_ms: dict[str, float] = {}
        binned = bin_rows(pair, rows)
        # The segments need no disparity: they are found beside the matching.
        graph_task = start(threads, self._segment, binned.left, stage_ms)
        with _timed(stage_ms, 'matching'):
            found = self._match(pair if is_whole else binned, preliminary, threads)
            evidence = self._evidence(binned, found, threads)
        before = found.disparity.values
        graph = graph_task.result()
        with _timed(stage_ms, 'planes'):
            match = (replace(found, disparity=self._map(bin_disparities(before, rows)))
                     if is_whole else found)
            segments, projected = apply_planes(
                match, evidence, graph, self.params.planes, threads, rows)
            overruled = (find_overruled(projected, match.disparity.values, rows, len(left))
                         if match.is_trusted else None)
            projected, segments = restore_rows(
                projected, segments, binned.left, left, rows, threads)
            if rows > 1:
                projected = self._at_full_size(projected, before if is_whole else None, segments)
        with _timed(stage_ms, 'filter'):
            refined = self._filter(projected, left, segments, threads)
            if overruled is not None:
                refined = take_back(refined, before, overruled)
        if not is_whole:
            before = repeat_rows(before, pair.shape[0], rows)
        return RefinementResult(
            self._map(refined), self._map(before), segments, found.lr_consistent_ratio,
            stage_ms, (time.perf_counter() - begin) * 1e3,
            np.where(np.isfinite(before), np.float32(0.9), np.float32(0.3)), PairHealth())

    def preliminary_only(self, left: Image, right: Image | None,
                         preliminary: FloatMap | None = None, threads: int | None = None
                         ) -> RefinementResult:
        """
        Return the preliminary disparity unrefined: what is left where refining fails.

        Parameters and errors are those of `process`. The map may have holes; what is valid has
        confidence 1, and the image is one unfitted segment.
        """
        begin = time.perf_counter()
        pair = StereoPair(left, right)
        stage_ms = dict.fromkeys(('matching', 'segmentation', 'planes', 'filter'), 0.0)
        with _timed(stage_ms, 'matching'):
            if preliminary is None:
                found = compute_match(
                    pair, self.params.matching, threads or self.params.processing.threads
                ).disparity
            else:
                found = self._map(_checked(preliminary, pair.shape))
        return RefinementResult(
            found, found, unfitted(np.zeros(pair.shape, np.int32), 1), float('nan'), stage_ms,
            (time.perf_counter() - begin) * 1e3, found.valid.astype(np.float32), PairHealth())

    def _segment(self, image: Image, stage_ms: dict[str, float]) -> SegmentGraph:
        with _timed(stage_ms, 'segmentation'):
            return build_segment_graph(image, self.params.segmentation)

    def _match(self, pair: StereoPair, preliminary: FloatMap | None, threads: int) -> Match:
        if preliminary is None:
            return compute_match(pair, self.params.matching, threads)
        is_guarded = self.params.planes.projection == 'guarded'
        return Match(self._map(preliminary), is_own=False,
                     is_trusted=is_guarded and follows_edges(preliminary, pair.left))

    def _evidence(self, pair: StereoPair, match: Match, threads: int) -> Evidence | None:
        """Gather what guards the projection; the scanline matcher has it already."""
        is_asked = self.params.planes.projection == 'guarded' and pair.right is not None
        if match.evidence is None and is_asked:
            return gather_evidence(pair, self.params.matching, threads)[0]
        return match.evidence

    def _at_full_size(self, restored: FloatMap, before: FloatMap | None,
                      segments: PlaneSegmentation) -> FloatMap:
        """Take back the detail of planes, and of a map from before its rows were averaged."""
        projection = self.params.planes.projection
        if projection == 'full':
            unfitted_values = self._map(restored if before is None else before)
            return put_on_planes(unfitted_values, segments)
        if before is None:
            return restored
        if segments.is_fitted.any():
            return keep_agreeing(restored, before)
        return fill_from_background(before) if projection == 'guarded' else before

    def _filter(self, values: FloatMap, left: Image, segments: PlaneSegmentation, threads: int
                ) -> FloatMap:
        # A guarded map in which no plane found support stays as its matcher made it.
        if self.params.planes.projection == 'guarded' and not segments.is_fitted.any():
            return values
        return apply_filter(values, left, self.params.filter, threads)

    def _map(self, values: FloatMap) -> DisparityMap:
        matching = self.params.matching
        return DisparityMap(values, matching.min_disparity, matching.num_disparities)


def _checked(preliminary: FloatMap, shape: tuple[int, int]) -> FloatMap:
    """Copy an external map; NaN becomes the only mark of an invalid disparity."""
    if not isinstance(preliminary, np.ndarray) or preliminary.shape != shape:
        raise ValueError(f'preliminary: expected a numpy array of shape {shape}, '
                         f'got {getattr(preliminary, "shape", type(preliminary).__name__)}')
    values = preliminary.astype(np.float32)
    values[~np.isfinite(values)] = np.nan
    return values


@contextmanager
def _timed(stage_ms: dict[str, float], stage: str) -> Iterator[None]:
    begin = time.perf_counter()
    yield
    stage_ms[stage] = (time.perf_counter() - begin) * 1e3

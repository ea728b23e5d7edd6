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

"""The whole method on one screen: rectify, match, segment, fit planes, choose, filter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stereo_refine_ros.graph.segment_graph import build_segment_graph, SegmentGraph
from stereo_refine_ros.health.pair import PairExaminer
from stereo_refine_ros.images import halve
from stereo_refine_ros.levels import (
    at_full_size, grid_scale, repeated, segments_at_full_size, to_grid)
from stereo_refine_ros.matching import check_memory, find_match
from stereo_refine_ros.params import Params
from stereo_refine_ros.rectification import columns_hold, RowOffset
from stereo_refine_ros.refinement.evidence import gather_evidence, match_half
from stereo_refine_ros.refinement.filters import apply_filter
from stereo_refine_ros.refinement.likelihood import probability
from stereo_refine_ros.refinement.plane_stage import (
    PlaneStage, Projected, PROJECTIONS, unfitted)
from stereo_refine_ros.refinement.steadying import FrameMemory
from stereo_refine_ros.stage_clock import StageClock
from stereo_refine_ros.threads import start
from stereo_refine_ros.types import (
    FloatMap, Image, PairHealth, PlaneSegmentation, RefinementResult, StereoPair)


class StereoRefiner:
    """
    Refine the disparity of one stereo pair after another (Hamzah et al. 2017, figure 2).

    `params` come from `load_preset`; build a new refiner to change them.
    """

    def __init__(self, params: Params) -> None:
        """Keep the parameters, and choose the variants they name."""
        self.params = params
        self._project = PROJECTIONS[params.planes.projection]
        self._examiner = PairExaminer(params)
        self._memory = FrameMemory() if params.temporal.enabled else None

    def follow(self, other: StereoRefiner) -> None:
        """Take over what a refiner with other parameters has learnt of the cameras."""
        self._examiner.follow(other._examiner)

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
        clock, pair = StageClock(), StereoPair(left, right)
        params, threads = self.params, threads or self.params.processing.threads
        check_memory(pair, params.matching)
        scale = grid_scale(pair.shape, params.processing.refine_pixels)
        graph = start(threads, self._segment, left, scale, clock)  # beside the matching
        with clock.timing('matching'):
            prepared = self._examiner.prepare(pair, threads)
            pair = prepared.pair
            half = start(threads, match_half, pair, params.matching)
            match = find_match(pair, preliminary, params.matching, threads)
            given = to_grid(match.disparity.values, scale, threads)
            evidence = gather_evidence(
                pair, match, given, half.result(), params.matching, scale, threads)
        segments = graph.result()
        with clock.timing('planes'):
            lowest = float(params.matching.min_disparity)
            data = given if match.subpixel is None else to_grid(match.subpixel, scale, threads)
            projected = self._project(PlaneStage(
                given, data, segments, evidence, lowest,
                lowest + params.matching.num_disparities - 1, match.rounding),
                params.planes, threads)
            beside = start(threads, _enlarged, projected, prepared.offset, pair.shape, scale,
                           threads)
            values = at_full_size(projected.choice, match.disparity.values, pair.left,
                                  evidence.image, scale, threads)
        with clock.timing('filter'):
            refined = apply_filter(values, left, params.filter, threads)
        confidence, planes = beside.result()
        health = self._examiner.examine(prepared, evidence.fine,
                                        None if match.is_own else projected.choice.given)
        if self._memory is not None:
            with clock.timing('filter'):
                refined, confidence = self._memory.steady(
                    refined, confidence, left, health.noise_sigma, threads, match.is_own)
        return RefinementResult(
            replace(match.disparity, values=refined), match.disparity, planes,
            match.lr_consistent_ratio, clock.stage_ms, clock.total_ms(), confidence, health)

    def preliminary_only(self, left: Image, right: Image | None,
                         preliminary: FloatMap | None = None, threads: int | None = None,
                         ) -> RefinementResult:
        """
        Return the preliminary disparity unrefined: what is left where refining fails.

        Parameters and errors are those of `process`. The map may have holes; what is valid has
        confidence 1, and the image is one unfitted segment.
        """
        clock, pair = StageClock(), StereoPair(left, right)
        with clock.timing('matching'):
            found = find_match(pair, preliminary, self.params.matching,
                               threads or self.params.processing.threads).disparity
        return RefinementResult(
            found, found, unfitted(np.zeros(pair.shape, np.int32), 1), float('nan'),
            clock.stage_ms, clock.total_ms(), found.valid.astype(np.float32), PairHealth())

    def _segment(self, left: Image, scale: int, clock: StageClock) -> SegmentGraph:
        with clock.timing('segmentation'):
            image = left if scale == 1 else halve(left)
            return build_segment_graph(image, self.params.segmentation, scale)


def _enlarged(projected: Projected, offset: RowOffset, shape: tuple[int, int],
              scale: int, threads: int) -> tuple[FloatMap, PlaneSegmentation]:
    """Bring the confidence and the segments of a projection from the grid to full size."""
    hold = columns_hold(projected.choice.values, offset, shape[1], scale, threads)
    confidence = repeated(probability(projected.odds) * hold, shape, scale)
    return (np.ascontiguousarray(confidence),
            segments_at_full_size(projected.segments, shape, scale))

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

"""
The plane stage: fit, merge, adopt; then project, by the projection that the parameters name.

Every projection is a function `project(stage, params, threads)` that returns what it made of the
map on the grid. `project_guarded` is the heart of the package: it chooses, pixel by pixel, what
is likeliest.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.graph.segment_graph import SegmentGraph
from stereo_refine_ros.levels import Choice, unround
from stereo_refine_ros.params import PlaneParams
from stereo_refine_ros.refinement.candidates import propose
from stereo_refine_ros.refinement.choice import choose, settle, take
from stereo_refine_ros.refinement.filling import fill_from_background
from stereo_refine_ros.refinement.likelihood import (
    Evidence, log_odds, misfit_around, PlaneMap, survey)
from stereo_refine_ros.refinement.plane_sharing import adopt_planes, merge_coplanar
from stereo_refine_ros.refinement.planes import fit_planes
from stereo_refine_ros.refinement.projection import fill_along_planes, plane_disparities
from stereo_refine_ros.refinement.tuning import ADOPTED_QUALITY
from stereo_refine_ros.threads import start
from stereo_refine_ros.types import FloatMap, LabelMap, PlaneSegmentation


@dataclass(frozen=True, eq=False)
class PlaneStage:
    """
    What planes are made of, on one grid.

    Attributes
    ----------
    given : float32 ndarray of shape (H, W)
        The map to refine, NaN where it has holes.
    data : float32 ndarray of shape (H, W)
        What planes are fitted to: `given`, or what its matcher measured below it.
    graph : SegmentGraph
    evidence : Evidence
    lowest, highest : float
        The range that planes are held in.
    rounding : float
        By how many pixels `given` was rounded: 0.5 where its disparities are whole, else 0.

    """

    given: FloatMap
    data: FloatMap
    graph: SegmentGraph
    evidence: Evidence
    lowest: float
    highest: float
    rounding: float = 0.0


@dataclass(frozen=True, eq=False)
class Projected:
    """A map on the grid, its log-odds, and the segments that it rests on."""

    choice: Choice
    odds: FloatMap
    segments: PlaneSegmentation


Projection = Callable[[PlaneStage, PlaneParams, int], Projected]


def unfitted(labels: LabelMap, count: int) -> PlaneSegmentation:
    """Segments without planes, for a pipeline that leaves the planes out."""
    return PlaneSegmentation(labels, np.full((count, 3), np.nan), np.zeros(count, np.bool_),
                             np.zeros(count, np.float32))


def project_off(stage: PlaneStage, params: PlaneParams, threads: int = 1) -> Projected:
    """Leave the planes out: the segments have none, and the map stays as it came."""
    segments = unfitted(stage.graph.labels, stage.graph.count)
    unknown = np.full_like(stage.given, np.nan)
    zero = np.zeros_like(stage.given)
    nothing = PlaneMap(unknown, zero, unknown, unknown, zero, zero)
    nowhere = np.zeros(stage.given.shape, np.bool_)
    return _literal(stage, stage.given, nowhere, nothing, segments, threads)


def project_full(stage: PlaneStage, params: PlaneParams, threads: int = 1) -> Projected:
    """
    Give every pixel of a fitted segment its plane, as the paper does (section 2.4).

    Segments whose inlier ratio is too low keep what they had, holes included.
    """
    fits = fit_planes(stage.graph.lists, stage.data, params, threads)
    is_fitted = fits.inlier_ratio >= max(params.min_inlier_ratio, 1e-6)
    planes = np.where(is_fitted[:, None], fits.planes, np.nan)
    unbounded = np.concatenate([planes[:, :3], np.full((len(planes), 2), np.inf)], axis=1)
    unbounded[:, 3] *= -1
    values = plane_disparities(
        stage.graph.labels, unbounded, stage.lowest, stage.highest, threads)
    segments = PlaneSegmentation(
        stage.graph.labels, np.ascontiguousarray(planes[:, :3]), is_fitted, fits.inlier_ratio)
    quality = np.where(is_fitted, fits.inlier_ratio, 0).astype(np.float32)
    return _literal(stage, np.where(np.isnan(values), stage.given, values), ~np.isnan(values),
                    _plane_map(stage, planes, quality, values, (values, values)), segments,
                    threads)


def project_guarded(stage: PlaneStage, params: PlaneParams, threads: int = 1) -> Projected:
    """Choose between what was given, the planes and what the matches say; fill every hole."""
    surveyed = start(threads, survey, stage.given, stage.evidence)  # beside the planes
    segments, planes = share_planes(stage, params, threads)
    maps = propose(stage.given, planes, stage.evidence, threads)
    if np.isnan(maps[0]).any():  # not one disparity came
        return project_off(stage, params, threads)
    odds = log_odds(maps, stage.given, planes, stage.evidence, threads, surveyed.result())
    weights = stage.graph.weights
    which = choose(maps, odds, stage.given, weights, threads)
    chosen = settle(take(odds, which, threads), weights, stage.evidence.image, threads)
    values = take(maps, which, threads)
    if stage.rounding:
        is_likely = (which == 0) & (odds[1] >= odds[0])  # the plane
        values = unround(values, planes.values, stage.rounding, is_likely, threads)
    choice = Choice(stage.given, values, which > 0, rounding=stage.rounding)
    return Projected(choice, chosen, segments)


def share_planes(stage: PlaneStage, params: PlaneParams, threads: int,
                  ) -> tuple[PlaneSegmentation, PlaneMap]:  # noqa: E124
    """Fit a plane to every segment, merge what is coplanar, adopt where a segment has no data."""
    graph = stage.graph
    fits = fit_planes(graph.lists, stage.data, params, threads)
    merged = merge_coplanar(fits, graph.borders, params)
    shared, own = adopt_planes(merged, fits, graph.borders, params)
    planes = shared.by_segment()
    is_fitted = own & (shared.index >= 0)
    quality = np.where(own, fits.inlier_ratio, np.float32(ADOPTED_QUALITY))
    quality[shared.index < 0] = 0
    span = stage.lowest, stage.highest
    values = plane_disparities(graph.labels, planes, *span, threads)
    beside = fill_along_planes(stage.given, graph.labels, planes, *span, threads)
    segments = PlaneSegmentation(graph.labels, np.ascontiguousarray(planes[:, :3]), is_fitted,
                                 fits.inlier_ratio, shared.index)
    return segments, _plane_map(stage, planes, quality.astype(np.float32), values, beside)


def _plane_map(stage: PlaneStage, planes: NDArray[np.float64], quality: NDArray[np.float32],
               values: FloatMap, beside: tuple[FloatMap, FloatMap]) -> PlaneMap:
    """Spread over the pixels what is known of the planes of their segments."""
    slopes = np.nan_to_num(np.abs(planes[:, :2])).sum(axis=1) / stage.evidence.scale
    labels = stage.graph.labels
    return PlaneMap(values, quality[labels], *beside,
                    np.minimum(slopes, 1).astype(np.float32)[labels],
                    misfit_around(stage.evidence.fine, values))


def _literal(stage: PlaneStage, values: FloatMap, is_moved: np.ndarray, planes: PlaneMap,
             segments: PlaneSegmentation, threads: int) -> Projected:
    """Judge a map that nothing may change."""
    filled = fill_from_background(values)
    odds = np.full(values.shape, -np.inf, np.float32)
    if not np.isnan(filled).any():
        odds = settle(log_odds(filled[np.newaxis], stage.given, planes, stage.evidence,
                               threads)[0], stage.graph.weights, stage.evidence.image, threads)
    return Projected(Choice(stage.given, values, is_moved, is_literal=True), odds, segments)


PROJECTIONS: dict[str, Projection] = {
    'off': project_off,
    'full': project_full,
    'guarded': project_guarded,
}

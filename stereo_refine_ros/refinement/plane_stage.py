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
The plane stage: fit, merge, adopt, select and project; the projection by name.

Every projection is a function `project(match, evidence, graph, params, threads, rows)` that
returns the segments with their planes, and the map.

`project_guarded` is the heart of the package: from a preliminary disparity with holes to a
dense one whose every change has evidence in the images.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.graph.segment_graph import SegmentGraph
from stereo_refine_ros.matching.consistency import left_right_check, remove_speckles
from stereo_refine_ros.matching.evidence import Evidence
from stereo_refine_ros.matching.match import Match
from stereo_refine_ros.params import PlaneParams
from stereo_refine_ros.refinement.filling import fill_from_background
from stereo_refine_ros.refinement.plane_selection import select_planes
from stereo_refine_ros.refinement.plane_sharing import adopt_planes, merge_coplanar, SharedPlanes
from stereo_refine_ros.refinement.planes import fit_planes, PlaneFits
from stereo_refine_ros.refinement.projection import ALIKE, choose_candidates, plane_disparities
from stereo_refine_ros.refinement.spreading import spread_disparities
from stereo_refine_ros.types import DisparityMap, FloatMap, LabelMap, PlaneSegmentation

# Fit data farther than this from the map to begin with are outliers of the matcher,
_FIT_REACH = 2.0
# ... and farther than this from what the right view saw there are not its match.
_CONFIRMED_REACH = 1.5
# What was chosen takes the sub-pixel disparity of its match, else of its plane, within:
_DATA_REACH, _PLANE_REACH = 0.6, 1.0
# A map of which less than this share is confirmed belongs to other images, or another
# calibration: its holes are filled, and nothing else is changed.
_BELONGS = 0.3
_SPREAD_MEDIAN = 3
# Islands of the scanline matcher that small and that far from all around them are wrong: pixels
# of the image, and of disparity. Other matchers see to their own.
_SPECKLE, _SPECKLE_STEP = 60, 2.0
# Where the images speak for what a matcher said, a plane has to be this much better, in cost.
# ... better still where rows are averaged, which blurs what the images say of others' maps, and
# by most of what a cost can be (three, in all) where a map is to be trusted.
_INERTIA, _BLURRED_INERTIA, _TRUSTED_INERTIA = 0.1, 0.4, 2.3

Projection = Callable[[Match, Evidence | None, SegmentGraph, PlaneParams, int, int],
                      tuple[PlaneSegmentation, FloatMap]]


def unfitted(labels: LabelMap, count: int) -> PlaneSegmentation:
    """Segments without planes, for a pipeline that leaves the planes out."""
    return PlaneSegmentation(labels, np.full((count, 3), np.nan), np.zeros(count, np.bool_),
                             np.zeros(count, np.float32))


def apply_planes(match: Match, evidence: Evidence | None, graph: SegmentGraph,
                 params: PlaneParams, threads: int = 1, rows: int = 1,
                 ) -> tuple[PlaneSegmentation, FloatMap]:
    """
    Fit planes and project them, by the projection that `params.projection` names.

    Raises
    ------
    ValueError
        For an unknown projection.

    """
    if params.projection not in PROJECTIONS:
        raise ValueError(f'planes.projection: {params.projection!r} is none of '
                         f'{", ".join(PROJECTIONS)}')
    return PROJECTIONS[params.projection](match, evidence, graph, params, threads, rows)


def project_off(match: Match, evidence: Evidence | None, graph: SegmentGraph,
                params: PlaneParams, threads: int = 1, rows: int = 1,
                ) -> tuple[PlaneSegmentation, FloatMap]:
    """Leave the planes out: the segments have none, and the map stays as it came."""
    return unfitted(graph.labels, graph.count), match.disparity.values


def project_full(match: Match, evidence: Evidence | None, graph: SegmentGraph,
                 params: PlaneParams, threads: int = 1, rows: int = 1,
                 ) -> tuple[PlaneSegmentation, FloatMap]:
    """
    Give every pixel of a fitted segment its plane, as the paper does (section 2.4).

    Segments whose inlier ratio is too low keep what they had, holes included.
    """
    fits = fit_planes(graph.lists, match.fit_data, params, threads)
    is_fitted = fits.inlier_ratio >= max(params.min_inlier_ratio, 1e-6)
    planes = np.where(is_fitted[:, None], fits.planes, np.nan)
    segments = PlaneSegmentation(
        graph.labels, np.ascontiguousarray(planes[:, :3]), is_fitted, fits.inlier_ratio)
    return segments, put_on_planes(match.disparity, segments)


def put_on_planes(disparity: DisparityMap, segments: PlaneSegmentation) -> FloatMap:
    """Give every pixel of a fitted segment its plane, within the range; the others keep theirs."""
    planes = np.full((len(segments.planes), 5), np.nan)
    planes[segments.is_fitted, :3] = segments.planes[segments.is_fitted]
    planes[:, 3:] = -np.inf, np.inf
    projected = plane_disparities(segments.labels, planes, *_range(disparity))
    return np.where(np.isnan(projected), disparity.values, projected)


def project_guarded(match: Match, evidence: Evidence | None, graph: SegmentGraph,
                    params: PlaneParams, threads: int = 1, rows: int = 1,
                    ) -> tuple[PlaneSegmentation, FloatMap]:
    """
    Let the planes change the map where the evidence says so, and fill its holes.

    Without evidence (no right view) valid pixels keep their disparity. `rows` of the image are
    one of the map: the speckles of a map are so much smaller.

    Returns
    -------
    segments : PlaneSegmentation
    values : float32 ndarray of shape (H, W)
        Dense, unless the preliminary map has no valid pixel at all.

    """
    data = match.fit_data
    if evidence is not None and match.evidence is None:
        given = np.count_nonzero(np.isfinite(data))
        data = _confirmed(data, evidence)
        if np.count_nonzero(np.isfinite(data)) < _BELONGS * given:
            return (unfitted(graph.labels, graph.count),
                    fill_from_background(match.disparity.values))
    matched = np.isfinite(data)
    is_spread = params.spread and match.evidence is not None and bool(matched.any())
    kept = (match.disparity.values if is_spread or match.evidence is None
            else remove_speckles(match.disparity.values, _SPECKLE // rows, _SPECKLE_STEP))
    begin = _spread(match, graph, threads) if is_spread else fill_from_background(kept)
    near = np.where(np.abs(data - begin) <= _FIT_REACH, data, np.float32(np.nan))
    fits = fit_planes(graph.lists, near, params, threads)
    shared, own = _share(fits, graph, evidence, matched, params)
    planes = shared.by_segment()
    proposed = plane_disparities(graph.labels, planes, *_range(match.disparity))
    if evidence is None:
        values = np.where(matched | np.isnan(proposed), begin, proposed)
    else:
        inertia = 0.0 if is_spread else _inertia(match, rows)
        values = choose_candidates(proposed, begin, np.isfinite(kept), evidence,
                                   graph.weights, inertia, match.is_trusted, threads)
    if is_spread:
        values = _with_subpixel(values, data, proposed)
    else:
        values = np.where(np.abs(kept - values) < ALIKE, kept, values)
    segments = PlaneSegmentation(
        graph.labels, np.ascontiguousarray(planes[:, :3]), own & (shared.index >= 0),
        fits.inlier_ratio, shared.index)
    return segments, values


def _inertia(match: Match, rows: int) -> float:
    if match.is_trusted:
        return _TRUSTED_INERTIA
    return _BLURRED_INERTIA if rows > 1 and match.evidence is None else _INERTIA


def _confirmed(data: FloatMap, evidence: Evidence) -> FloatMap:
    """Keep the disparities of a matcher that the right view of the evidence agrees with."""
    right = np.where(evidence.right < 0, np.float32(np.nan),
                     (evidence.right + evidence.min_disparity).astype(np.float32))
    return np.where(left_right_check(data, right, _CONFIRMED_REACH), data, np.float32(np.nan))


def _spread(match: Match, graph: SegmentGraph, threads: int) -> FloatMap:
    """Let the matched pixels vote for the whole disparity of every pixel."""
    votes = spread_disparities(np.rint(match.fit_data), graph.weights,
                               match.disparity.min_disparity, match.disparity.num_disparities,
                               threads)
    return cv2.medianBlur(votes, _SPREAD_MEDIAN)


def _with_subpixel(chosen: FloatMap, data: FloatMap, planes: FloatMap) -> FloatMap:
    """Put the sub-pixel disparity of the match where it is near, else that of the plane."""
    near_plane = np.where(np.abs(planes - chosen) <= _PLANE_REACH, planes, chosen)
    return np.where(np.abs(data - chosen) <= _DATA_REACH, data, near_plane)


def _share(fits: PlaneFits, graph: SegmentGraph, evidence: Evidence | None,
           matched: NDArray[np.bool_], params: PlaneParams,
           ) -> tuple[SharedPlanes, NDArray[np.bool_]]:
    """Merge, adopt, select; `own` marks segments whose plane rests on their own data."""
    merged = merge_coplanar(fits, graph.borders, params)
    planes, own = adopt_planes(merged, fits, graph.borders, params)
    if evidence is not None:
        planes = select_planes(planes, graph.lists, graph.borders, evidence, matched)
    return planes, own


def _range(disparity: DisparityMap) -> tuple[float, float]:
    first = disparity.min_disparity
    return float(first), float(first + disparity.num_disparities - 1)


PROJECTIONS: dict[str, Projection] = {
    'off': project_off,
    'full': project_full,
    'guarded': project_guarded,
}

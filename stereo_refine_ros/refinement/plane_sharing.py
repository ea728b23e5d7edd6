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
Planes across segment borders: coplanar neighbours merge, segments without evidence adopt.

A table that falls apart into ten segments is still one plane, and a segment that the matcher
could not see lies most likely on the plane of the neighbour it resembles.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from numba import njit
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.graph.disjoint_set import find, make_sets, union
from stereo_refine_ros.graph.segment_graph import Borders
from stereo_refine_ros.params import PlaneParams
from stereo_refine_ros.refinement.planes import plane_of_moments, PlaneFits, residual_variance
from stereo_refine_ros.refinement.tuning import ADOPTION_PASSES, MERGE_RISE, MIN_DATA


@dataclass(frozen=True, eq=False)
class SharedPlanes:
    """
    Planes, and which of them every segment has: one plane may lie under many segments.

    Attributes
    ----------
    coefficients : float64 ndarray of shape (M, 5), finite
        Columns a, b, c, and the least and the largest disparity among the inliers.
    index : int32 ndarray of shape (N,)
        Row of `coefficients` for each segment, -1 where it has no plane. Not every plane need
        still have a segment.

    """

    coefficients: NDArray[np.float64]
    index: NDArray[np.int32]

    def by_segment(self) -> NDArray[np.float64]:
        """Return the plane of every segment, float64 (N, 5), NaN where it has none."""
        planes = np.full((len(self.index), 5), np.nan)
        has_plane = self.index >= 0
        planes[has_plane] = self.coefficients[self.index[has_plane]]
        return planes


def merge_coplanar(fits: PlaneFits, borders: Borders, params: PlaneParams) -> SharedPlanes:
    """
    Replace the planes of coplanar neighbours by their joint plane, most alike in colour first.

    A joint plane has the range of all its parts; segments without a fit have no plane.
    """
    count = fits.planes.shape[0]
    order = np.argsort(borders.color_distance, kind='stable')
    parent, size = make_sets(count)
    trusted = (fits.inlier_ratio >= params.min_inlier_ratio) & (fits.moments[:, 0] >= MIN_DATA)
    planes = fits.planes.copy()
    roots = np.empty(count, np.int32)
    _merge_kernel(borders.pairs[order], trusted, fits.moments.copy(), planes, parent, size, roots)
    is_plane = (roots == np.arange(count)) & np.isfinite(planes[:, 0])
    number = np.where(is_plane, np.cumsum(is_plane) - 1, -1).astype(np.int32)
    return SharedPlanes(planes[is_plane], number[roots])


def adopt_planes(planes: SharedPlanes, fits: PlaneFits, borders: Borders, params: PlaneParams,
                 ) -> tuple[SharedPlanes, NDArray[np.bool_]]:
    """
    Give segments without evidence the plane of the neighbour that they most resemble.

    Returns
    -------
    planes : SharedPlanes
        -1 where no neighbour had a plane to give.
    own : bool ndarray of shape (N,)
        True where the plane rests on the segment's own data.

    """
    own = (fits.data_count >= MIN_DATA) & (fits.inlier_ratio >= params.min_inlier_ratio)
    unlikeness = (borders.color_distance - 2 * np.log(borders.length)).astype(np.float64)
    index = np.where(own, planes.index, np.int32(-1))
    _adopt_kernel(borders.pairs, unlikeness, index)
    return replace(planes, index=index), own


@njit(cache=True, nogil=True)
def _merge_kernel(pairs, trusted, moments, planes, parent, size, roots):
    for i in range(pairs.shape[0]):
        if not (trusted[pairs[i, 0]] and trusted[pairs[i, 1]]):
            continue
        a, b = find(parent, pairs[i, 0]), find(parent, pairs[i, 1])
        if a == b:
            continue
        joint = moments[a] + moments[b]
        plane = plane_of_moments(joint)
        if _rises(moments[a], planes[a], plane) or _rises(moments[b], planes[b], plane):
            continue
        root = union(parent, size, a, b)
        moments[root] = joint
        low, high = min(planes[a, 3], planes[b, 3]), max(planes[a, 4], planes[b, 4])
        planes[root, 0], planes[root, 1], planes[root, 2] = plane
        planes[root, 3], planes[root, 4] = low, high
    for label in range(parent.shape[0]):
        roots[label] = find(parent, label)


@njit(cache=True, nogil=True)
def _rises(sums, old, new):
    before = residual_variance(sums, (old[0], old[1], old[2]))
    return residual_variance(sums, new) - before > MERGE_RISE


@njit(cache=True, nogil=True)
def _adopt_kernel(pairs, unlikeness, index):
    count = index.shape[0]
    for _ in range(ADOPTION_PASSES):
        least = np.full(count, np.inf)
        giver = np.full(count, -1, np.int64)
        for i in range(pairs.shape[0]):
            for side in range(2):
                taker, other = pairs[i, side], pairs[i, 1 - side]
                if index[taker] < 0 <= index[other] and unlikeness[i] < least[taker]:
                    least[taker] = unlikeness[i]
                    giver[taker] = other
        if giver.max() < 0:
            break
        for label in range(count):
            if giver[label] >= 0:
                index[label] = index[giver[label]]

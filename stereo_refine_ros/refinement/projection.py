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
Projection of the planes into the disparity map, full as in the paper or guarded by evidence.

Guarded, every pixel has candidates: what it had, and what the planes say. Each candidate costs
what the optimised matching volume says against it; a candidate that the right view occludes is
no evidence at all, and then the plane is the better guess. Neighbours of like colour add their
costs, and the cheapest candidate wins.
"""

from __future__ import annotations

from numba import njit
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.graph.support import sweep
from stereo_refine_ros.matching.evidence import Evidence, TOTAL_UNIT
from stereo_refine_ros.refinement.planes import bounded_disparity
from stereo_refine_ros.threads import run_bands
from stereo_refine_ros.types import FloatMap, LabelMap

_LARGEST_COST = 2.0
# A disparity that the right view cannot show: hidden there, or beyond its border.
_INVISIBLE = 0.1
# Where nothing can be seen, the plane is preferred to what filled a hole.
_BLIND_GUESS = 1.0
# The right view sees something farther there: the candidate would have to be visible.
_TRANSPARENT = 1.0
# Candidates closer than this need no evidence: one is as good as the other, pixels.
ALIKE = 0.4
# A cost below this contradicts nothing.
_UNCONTESTED = 0.2
# Colour change that a pixel's vote survives, in units of 255.
_VOTE_SIGMA = 0.02


def plane_disparities(labels: LabelMap, planes: NDArray[np.float64], low: float,
                      high: float) -> FloatMap:
    """Evaluate every pixel's plane, limited to low..high; NaN where its segment has none."""
    values = np.empty(labels.shape, np.float32)
    _plane_kernel(labels, planes, low, high, values)
    return values


def choose_candidates(proposed: FloatMap, begin: FloatMap, is_given: NDArray[np.bool_],
                      evidence: Evidence, weights: NDArray[np.uint8], inertia: float = 0.0,
                      is_trusted: bool = False, threads: int = 1) -> FloatMap:
    """
    Choose between the planes' disparities and those there were, pixel by pixel.

    Parameters
    ----------
    proposed : float32 ndarray of shape (H, W)
        The planes' disparities; NaN is never chosen.
    begin : float32 ndarray of shape (H, W)
        A dense map; it stays where nothing tells the two apart.
    is_given : bool ndarray of shape (H, W)
        Pixels that a matcher had a disparity for; elsewhere `begin` fills a hole.
    evidence : Evidence
        Of the image pair.
    weights : uint8 ndarray of shape (H, W, 2)
        Edge weights of the image's pixel graph: who counts as a neighbour.
    inertia : float
        What a given disparity that the images do not contradict is worth, in units of cost.
    is_trusted : bool
        Whether all that was given is worth that, contradicted or not.
    threads : int
        At most.

    Returns
    -------
    float32 ndarray of shape (H, W)

    """
    proposed = np.where(np.isnan(proposed), begin, proposed)
    view = (evidence.total, evidence.least, evidence.right, evidence.min_disparity,
            evidence.num_disparities, TOTAL_UNIT)
    gain = np.empty_like(proposed)
    run_bands(_gain_kernel, proposed.shape[0], threads, proposed, begin, is_given, view,
              inertia, is_trusted, gain)
    return np.where(sweep(gain, weights, _VOTE_SIGMA) >= 0, begin, proposed)


@njit(cache=True, nogil=True)
def _plane_kernel(labels, planes, low, high, values):
    height, width = labels.shape
    for y in range(height):
        for x in range(width):
            plane = planes[labels[y, x]]
            if np.isnan(plane[0]):
                values[y, x] = np.nan
            else:
                values[y, x] = min(max(bounded_disparity(plane, x, y), low), high)


@njit(cache=True, nogil=True)
def _gain_kernel(start, stop, proposed, other, is_given, evidence, inertia, is_trusted,
                 gain):
    """Set what `other` costs less than `proposed`, rows start..stop; 0 where they are one."""
    for y in range(start, stop):
        for x in range(proposed.shape[1]):
            gain[y, x] = 0
            if not abs(proposed[y, x] - other[y, x]) >= ALIKE:  # also where they are NaN
                continue
            kept, is_visible = _candidate_cost(y, x, other[y, x], evidence)
            cost, _ = _candidate_cost(y, x, proposed[y, x], evidence)
            if is_given[y, x]:
                if is_trusted or (is_visible and kept < _UNCONTESTED):
                    cost += inertia
            elif not is_visible:
                kept += _BLIND_GUESS
            gain[y, x] = cost - kept


@njit(cache=True, nogil=True)
def _candidate_cost(y, x, d, evidence):
    """Return the cost of a disparity, and whether the right view can show it at all."""
    total, least, right, min_disparity, depth, unit = evidence
    partner = int(np.floor(x - d + 0.5))
    if partner < 0 or partner >= right.shape[1]:
        return _INVISIBLE, False
    seen = right[y, partner]
    if seen >= 0 and seen + min_disparity > d + 1:
        return _INVISIBLE, False  # behind what the right view shows
    index = min(max(d - min_disparity, 0.0), depth - 1.0)
    low = int(index)
    rest = index - low
    high = min(low + 1, depth - 1)
    excess = total[y, x, low] * (1 - rest) + total[y, x, high] * rest - least[y, x]
    cost = min(excess / unit, _LARGEST_COST)
    if seen >= 0 and seen + min_disparity < d - 1:
        cost += _TRANSPARENT
    return cost, True

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
Choice among planes: every segment takes the one plane, its own or a neighbour's, that fits best.

A wrong match that is consistent within a segment gives a good fit and a wrong plane. Only the
images and the neighbours can tell: the energy of a plane is the matching cost it has inside the
segment, plus the steps it makes along borders that show no contrast. Minimised segment by
segment, once (one pass of iterated conditional modes), like the label stage of segment-based
stereo.
"""

from __future__ import annotations

from dataclasses import replace

from numba import njit
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.graph.segment_graph import Borders, PixelLists
from stereo_refine_ros.matching.evidence import Evidence
from stereo_refine_ros.matching.robust_cost import COST_UNIT
from stereo_refine_ros.refinement.plane_sharing import SharedPlanes
from stereo_refine_ros.refinement.planes import bounded_disparity

# Pixels of a segment that its planes are tried on.
_SAMPLES = 32
# Cost of a unit of border whose two planes differ by a pixel, at no contrast.
_SMOOTHNESS = 4.0
_COLOR_SCALE = 30.0
_LARGEST_STEP = 2.0
# Cost of an unmatched pixel that a plane would explain as occluded or out of view.
_INVISIBLE = 0.65
# ... and of one that did find a consistent match: it cannot be invisible.
_CONTRADICTED = 2.0


def select_planes(planes: SharedPlanes, lists: PixelLists, borders: Borders,
                  evidence: Evidence, matched: NDArray[np.bool_]) -> SharedPlanes:
    """
    Let segments take over neighbours' planes where that lowers the energy.

    Parameters
    ----------
    planes : SharedPlanes
        After adoption.
    lists : PixelLists
        The pixels of every segment.
    borders : Borders
        Which segments touch, how long and how alike in colour.
    evidence : Evidence
        What the matcher knows of each disparity.
    matched : bool ndarray of shape (H, W)
        Pixels whose match passed the left-right check.

    """
    count = len(planes.index)
    ends = borders.pairs.T.reshape(-1)
    order = np.argsort(ends, kind='stable')
    touching = (order % len(borders.pairs)).astype(np.int32) if len(order) else order
    first = np.searchsorted(ends[order], np.arange(count + 1))
    weight = (_SMOOTHNESS * borders.length
              * np.exp(-borders.color_distance / _COLOR_SCALE)).astype(np.float64)
    index = planes.index.copy()
    _select_kernel(planes.coefficients, index, lists.pixels, lists.starts, borders.pairs,
                   borders.middle, weight, touching, first, (
                       evidence.cost, evidence.right, evidence.min_disparity,
                       evidence.num_disparities, float(COST_UNIT)), matched)
    return replace(planes, index=index)


@njit(cache=True, nogil=True)
def _select_kernel(planes, index, pixels, starts, pairs, middle, weight, touching, first,
                   evidence, matched):
    for label in range(index.shape[0]):
        borders = touching[first[label]:first[label + 1]]
        members = pixels[starts[label]:starts[label + 1]]
        giver = -1
        lowest = np.inf
        if index[label] >= 0:
            giver = index[label]
            lowest = (_data_energy(planes[giver], members, evidence, matched)
                      + _step_energy(giver, label, borders, pairs, middle, weight, planes, index))
        for border in borders:
            other = index[pairs[border, 0] + pairs[border, 1] - label]
            if other < 0 or other == index[label]:
                continue
            energy = _step_energy(other, label, borders, pairs, middle, weight, planes, index)
            if energy < lowest:
                energy += _data_energy(planes[other], members, evidence, matched)
            if energy < lowest:
                lowest, giver = energy, other
        index[label] = giver


@njit(cache=True, nogil=True)
def _data_energy(plane, members, evidence, matched):
    """Sum the matching cost of a plane over a segment, from a sample of its pixels."""
    width = matched.shape[1]
    step = max(1, members.shape[0] // _SAMPLES)
    energy = 0.0
    tried = 0
    for i in range(0, members.shape[0], step):
        x, y = members[i] % width, members[i] // width
        d = bounded_disparity(plane, x, y)
        energy += _pixel_cost(x, y, d, evidence, matched[y, x])
        tried += 1
    return energy / tried * members.shape[0]


@njit(cache=True, nogil=True)
def _step_energy(number, label, borders, pairs, middle, weight, planes, index):
    """Cost of the steps that a plane makes at the middle of every border of its segment."""
    energy = 0.0
    plane = planes[number]
    for border in borders:
        neighbour = index[pairs[border, 0] + pairs[border, 1] - label]
        if neighbour >= 0:
            other = planes[neighbour]
            step = abs((plane[0] - other[0]) * middle[border, 0]
                       + (plane[1] - other[1]) * middle[border, 1] + plane[2] - other[2])
            energy += weight[border] * min(step, _LARGEST_STEP)
    return energy


@njit(cache=True, nogil=True)
def _pixel_cost(x, y, d, evidence, is_matched):
    cost, right, min_disparity, depth, unit = evidence
    width = cost.shape[1]
    partner = int(np.floor(x - d + 0.5))
    if partner < 0 or partner >= width:
        return _CONTRADICTED if is_matched else _INVISIBLE
    seen = right[y, partner]
    if seen >= 0 and seen + min_disparity > d + 1.0 and not is_matched:
        return _INVISIBLE
    index = d - min_disparity
    if index < 0 or index > depth - 1:
        return _CONTRADICTED
    low = int(index)
    rest = index - low
    high = min(low + 1, depth - 1)
    return (cost[y, x, low] * (1 - rest) + cost[y, x, high] * rest) / unit

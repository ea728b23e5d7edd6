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

"""The likelihood, pixel by pixel in plain Python: slow, and said in the words of FEATURES."""

from __future__ import annotations

import math

import numpy as np

from stereo_refine_ros.refinement.likelihood import FEATURES
from stereo_refine_ros.refinement.tuning import (
    AROUND_WINDOW, COLOR_SCALE, LOCAL_WINDOW, REACH, REACH_GROWTH, RING, UNIQUE_WINDOW)


def features(maps, given, planes, evidence):
    """Return float64 (K, H, W, F), in the order of FEATURES."""
    out = np.empty((*maps.shape, len(FEATURES)))
    local = local_roughness(given)
    unique_around = window_mean(evidence.uniqueness, UNIQUE_WINDOW)
    apart = np.minimum(np.abs(evidence.fine - evidence.coarse), 2)
    disagreement = window_mean(np.where(np.isnan(apart), 1, apart), AROUND_WINDOW)
    for k, values in enumerate(maps):
        for y, x in np.ndindex(values.shape):
            found = {
                **votes(y, x, values[y, x], evidence),
                **of_planes(values[y, x], planes.values[y, x], planes.quality[y, x]),
                **of_given(values[y, x], given[y, x], local[y, x]),
                **of_matches(y, x, values[y, x], evidence),
                'bias': 1.0,
                'bend': bend_at(values, y, x),
                'border': float(is_at_border(given[y], x)),
                'slant': planes.slant[y, x], 'misfit': planes.misfit[y, x],
                'uniqueness_around': unique_around[y, x],
                'disagreement_around': disagreement[y, x]}
            found['hole_vote'] = found['hole'] * found['vote']
            beside = max(0.0, 1 - abs(np.nan_to_num(planes.behind[y, x], nan=1e9) - values[y, x]))
            for kind in ('hole', 'border'):
                found[f'{kind}_plane'] = found[kind] * found['plane_near']
                found[f'{kind}_behind'] = found[kind] * beside
            out[k, y, x] = [found[name] for name in FEATURES]
    return out


def votes(y, x, z, evidence):
    """Return what neighbours of like colour matched."""
    height, width = evidence.fine.shape
    image = evidence.image.reshape(height, width, -1).astype(int)
    every = known = agreeing = 0.0
    for down, right in RING.tolist():
        v, u = y + down, x + right
        if not (0 <= v < height and 0 <= u < width):
            continue
        change = np.abs(image[v, u] - image[y, x]).max() / COLOR_SCALE
        weight = 1 / (1 + change ** 2)
        every += weight
        if not math.isnan(evidence.fine[v, u]):
            known += weight
            limit = REACH + REACH_GROWTH * math.hypot(down, right) * evidence.scale
            agreeing += weight * (abs(evidence.fine[v, u] - z) <= limit)
    return {'vote': (agreeing + 0.5) / (known + 1) - 0.5,
            'around': (known / every if every else 0.0) - 0.5}


def of_planes(z, plane, quality):
    """Return what the plane says."""
    residual = 1.0 if math.isnan(plane) else min(abs(plane - z), 1.0)
    return {'plane_near': quality * (1 - residual), 'plane_far': quality * (residual >= 1)}


def of_given(z, given, local):
    """Return what the given map says."""
    is_hole = math.isnan(given)
    is_near = not is_hole and abs(given - z) <= 1
    is_far = not is_hole and not is_near
    return {'given_far': float(is_far), 'smooth_given': local * is_near,
            'smooth_ungiven': local * is_far, 'hole': float(is_hole)}


def of_matches(y, x, z, evidence):
    """Return what the matches of both resolutions and the right view say."""
    fine, coarse = evidence.fine[y, x], evidence.coarse[y, x]
    near = 0.0 if math.isnan(fine) else max(0.0, 1 - abs(fine - z))
    partner = math.floor(x - z / evidence.scale + 0.5)
    is_seen = 0 <= partner < evidence.fine.shape[1]
    shown = evidence.right[y, partner] if is_seen else math.nan
    return {'fine_near': near, 'coarse_far': float(abs(coarse - z) > 1),
            'uniqueness': evidence.uniqueness[y, x] if near > 0 else 0.0,
            'transparent': float(shown < z - 1), 'unseen': float(not is_seen)}


def local_roughness(given):
    """Log of the mean bend of the map around every pixel."""
    bend = bend_of(given)
    total = window_mean(np.nan_to_num(bend), LOCAL_WINDOW)
    share = window_mean(np.isfinite(bend).astype(float), LOCAL_WINDOW)
    return np.log(total / np.maximum(share, 0.05) + 0.01) + 2


def bend_of(values):
    """Mean of both second differences, each at most 1; NaN where a neighbour is missing."""
    bend = np.full(values.shape, np.nan)
    for y in range(1, values.shape[0] - 1):
        for x in range(1, values.shape[1] - 1):
            across = abs(values[y, x + 1] - 2 * values[y, x] + values[y, x - 1])
            along = abs(values[y + 1, x] - 2 * values[y, x] + values[y - 1, x])
            if not math.isnan(across + along):
                bend[y, x] = 0.5 * (min(across, 1) + min(along, 1))
    return bend


def is_at_border(row, x):
    """Whether nothing was given to the left of a pixel, or nothing to its right, or itself."""
    known = np.isfinite(row)
    return not known[x] and not (known[:x].any() and known[x:].any())


def bend_at(values, y, x):
    """Mean of both second differences of a map at a pixel, each at most 1."""
    def at(down, right):
        height, width = values.shape
        return float(values[min(max(y + down, 0), height - 1), min(max(x + right, 0), width - 1)])
    here = at(0, 0)
    bends = [min(abs(at(-v, -u) + at(v, u) - 2 * here), 1) for v, u in ((1, 0), (0, 1))]
    return sum(bends) / 2


def window_mean(values, size):
    """Average over a square, the map mirrored at its borders, the outermost pixels twice."""
    reach = size // 2
    padded = np.pad(values.astype(float), reach, mode='symmetric')
    out = np.empty(values.shape)
    for y, x in np.ndindex(values.shape):
        out[y, x] = padded[y:y + size, x:x + size].mean()
    return out

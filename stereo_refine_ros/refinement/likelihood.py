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
How likely a disparity is within a pixel of the truth.

One logistic model of a dozen and a half numbers answers for every disparity that anybody
proposes for a pixel, whoever proposed it: so the same answer chooses, is published, and refuses.
What decides is what matched pixels of like colour around it say, and whether a plane passes here.
The coefficients come from `scripts/fit_likelihood.py`.

References
----------
X. Hu and P. Mordohai, "A quantitative evaluation of confidence measures for stereo vision",
TPAMI 2012. M. Poggi et al., "On the confidence of stereo matching in a deep-learning era", TPAMI
2021.

"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
from numba import njit
import numpy as np

from stereo_refine_ros.refinement.likelihood_table import ALONE, PAIR
from stereo_refine_ros.refinement.tuning import (
    ALIKE, AROUND_WINDOW, COLOR_SCALE, LOCAL_WINDOW, REACH, REACH_GROWTH, RING, STEP)
from stereo_refine_ros.threads import run_bands
from stereo_refine_ros.types import FloatMap, Image

FEATURES = (
    'bias', 'vote', 'around', 'plane_near', 'plane_far', 'plane_residual', 'given_far',
    'smooth_given', 'smooth_ungiven', 'fine_near', 'coarse_far', 'uniqueness', 'bend', 'step',
    'transparent', 'unseen', 'hole', 'hole_vote', 'hole_plane', 'uniqueness_around',
    'disagreement_around')
_COUNT = len(FEATURES)
_NONE = np.float32(-1e6)  # stands for a missing disparity where NaN would cost time


@dataclass(frozen=True, eq=False)
class Evidence:
    """
    What is known of a pair, whatever map is to be judged, on the grid where that is done.

    Disparities are pixels of the full image everywhere.

    Attributes
    ----------
    image : uint8 ndarray of shape (H, W) or (H, W, 3)
        The left view.
    scale : int
        Full-size pixels per pixel of the grid: 1 or 2.
    fine, coarse : float32 ndarray of shape (H, W)
        Checked matches at full and at half resolution; NaN where there is none.
    uniqueness : float32 ndarray of shape (H, W), 0..2
        Of `fine`: by how much it beats all other disparities.
    right : float32 ndarray of shape (H, W)
        What the right view sees; NaN where unknown.
    has_right : bool
        False where only the left view came: `fine` is then the map given.

    """

    image: Image
    scale: int
    fine: FloatMap
    coarse: FloatMap
    uniqueness: FloatMap
    right: FloatMap
    has_right: bool = True


@dataclass(frozen=True, eq=False)
class PlaneMap:
    """
    What planes say of every pixel, float32 (H, W) each.

    Attributes
    ----------
    values : the disparity of the segment's plane, NaN for none
    quality : how far to believe it, 0..1
    behind, before : the planes beside a hole, the farther and the nearer; NaN for none

    """

    values: FloatMap
    quality: FloatMap
    behind: FloatMap
    before: FloatMap


def log_odds(maps: FloatMap, given: FloatMap, planes: PlaneMap, evidence: Evidence,
             threads: int = 1) -> FloatMap:
    """
    Judge candidate maps pixel by pixel.

    Parameters
    ----------
    maps : float32 ndarray of shape (K, H, W)
        Dense candidates.
    given : float32 ndarray of shape (H, W)
        What was to be refined, NaN where it has holes.
    planes, evidence
        On the same grid.
    threads : int
        Bands of rows side by side.

    Returns
    -------
    float32 ndarray of shape (K, H, W)
        Log-odds that each disparity is within 1 px of the truth.

    """
    table = np.array(PAIR if evidence.has_right else ALONE, np.float32)
    out = np.empty_like(maps)
    run_bands(_judge_kernel, maps.shape[1], threads, *_arguments(maps, given, planes, evidence),
              table, out, np.empty((0, 0, 0, 0), np.float32))
    return out


def features_at(maps: FloatMap, given: FloatMap, planes: PlaneMap, evidence: Evidence,
                ) -> FloatMap:
    """Return what the model looks at, float32 (K, H, W, F): to fit it."""
    out = np.empty((*maps.shape, _COUNT), np.float32)
    _judge_kernel(0, maps.shape[1], *_arguments(maps, given, planes, evidence),
                  np.zeros(_COUNT, np.float32), np.empty_like(maps), out)
    return out


def probability(odds: FloatMap) -> FloatMap:
    """Turn log-odds into a probability, 0..1."""
    return (1 / (1 + np.exp(-odds))).astype(np.float32)


def roughness(values: FloatMap) -> FloatMap:
    """
    Mean second differences of a map along rows and columns, each at most 1 px.

    NaN where a neighbour is missing.
    """
    bend = np.full(values.shape, np.nan, np.float32)
    _roughness_kernel(np.ascontiguousarray(values), bend)
    return bend


@njit(cache=True, nogil=True)
def _roughness_kernel(values, bend):
    one, twice = np.float32(1), np.float32(2)
    for y in range(1, values.shape[0] - 1):
        up, here, down = values[y - 1], values[y], values[y + 1]
        for x in range(1, values.shape[1] - 1):
            across = abs(here[x - 1] + here[x + 1] - twice * here[x])
            along = abs(up[x] + down[x] - twice * here[x])
            total = np.float32(0.5) * (min(across, one) + min(along, one))
            # A minimum may lose a NaN; their sum does not.
            bend[y, x] = total if across + along >= 0 else np.float32(np.nan)


def _arguments(maps: FloatMap, given: FloatMap, planes: PlaneMap, evidence: Evidence,
               ) -> tuple[object, ...]:
    reach = int(np.abs(RING).max())
    distance = np.hypot(RING[:, 0], RING[:, 1]) * evidence.scale
    allowed = (REACH + REACH_GROWTH * distance).astype(np.float32)
    channels = evidence.image.reshape(*given.shape, -1)
    planes_of_image = np.stack([
        cv2.copyMakeBorder(np.ascontiguousarray(channels[..., c]), reach, reach, reach, reach,
                           cv2.BORDER_REPLICATE) for c in range(channels.shape[2])])
    fine = cv2.copyMakeBorder(_filled(evidence.fine), reach, reach, reach, reach,
                              cv2.BORDER_CONSTANT, value=float(_NONE))
    inside = cv2.copyMakeBorder(np.ones(given.shape, np.float32), reach, reach, reach, reach,
                                cv2.BORDER_CONSTANT, value=0.0)
    local = _local_roughness(given)
    window = (AROUND_WINDOW, AROUND_WINDOW)
    unique_around = cv2.blur(evidence.uniqueness, window, borderType=cv2.BORDER_REFLECT)
    apart = np.minimum(np.nan_to_num(np.abs(evidence.fine - evidence.coarse), nan=1.0), 2)
    disagreement = cv2.blur(apart.astype(np.float32), window, borderType=cv2.BORDER_REFLECT)
    return (maps, _filled(given), _filled(planes.values), planes.quality, fine, inside,
            _filled(evidence.coarse), evidence.uniqueness, _filled(evidence.right), local,
            unique_around, disagreement, planes_of_image, RING, allowed, evidence.scale)


def _filled(values: FloatMap) -> FloatMap:
    return np.where(np.isnan(values), _NONE, values)


def _local_roughness(given: FloatMap) -> FloatMap:
    """Log of the mean bend of the map around every pixel, about -2.6..2."""
    bend = roughness(given)
    known = np.isfinite(bend).astype(np.float32)
    size = (LOCAL_WINDOW, LOCAL_WINDOW)
    total = cv2.blur(np.nan_to_num(bend), size, borderType=cv2.BORDER_REFLECT)
    share = cv2.blur(known, size, borderType=cv2.BORDER_REFLECT)
    return np.log(total / np.maximum(share, np.float32(0.05)) + np.float32(0.01)) + np.float32(2)


@njit(cache=True, nogil=True, error_model='numpy')
def _judge_kernel(start, stop, maps, given, plane, quality, fine, inside, coarse, uniqueness,
                  right, local, unique_around, disagreement, image, ring, allowed,
                  scale, table, odds, features):
    """Fill rows start..stop of `odds`; and of `features` (K, H, W, F), if asked."""
    count, _, width = maps.shape
    reach = (fine.shape[1] - width) // 2
    weight = np.empty(width, np.float32)
    known, every = np.empty(width, np.float32), np.empty(width, np.float32)
    agreeing = np.empty((count, width), np.float32)
    for y in range(start, stop):
        _count_votes(y, reach, maps, fine, inside, image, ring, allowed, weight, known, every,
                     agreeing)
        for k in range(count):
            for x in range(width):
                z = maps[k, y, x]
                # What is as good as the first needs no judgement of its own.
                if k > 0 and features.shape[0] == 0 and abs(z - maps[0, y, x]) <= ALIKE:
                    odds[k, y, x] = odds[0, y, x]
                    continue
                partner = int(np.floor(x - z / scale + np.float32(0.5)))
                is_seen = 0 <= partner < width
                seen = right[y, partner] if is_seen else _NONE
                g, p, f, c = given[y, x], plane[y, x], fine[y + reach, x + reach], coarse[y, x]
                residual = min(abs(p - z), np.float32(1))
                q = quality[y, x]
                is_given = g > _NONE
                is_near = is_given and abs(g - z) <= 1
                f_near = max(np.float32(0), np.float32(1) - abs(f - z))
                vote = (agreeing[k, x] + np.float32(0.5)) / (
                    known[x] + np.float32(1)) - np.float32(0.5)
                is_hole = np.float32(0) if is_given else np.float32(1)
                values = (
                    np.float32(1),
                    vote,
                    known[x] / max(every[x], np.float32(1e-6)) - np.float32(0.5),
                    q * (np.float32(1) - residual),
                    q if residual >= 1 else np.float32(0),
                    residual,
                    np.float32(1) if is_given and not is_near else np.float32(0),
                    local[y, x] if is_near else np.float32(0),
                    local[y, x] if is_given and not is_near else np.float32(0),
                    f_near,
                    np.float32(1) if c > _NONE and abs(c - z) > 1 else np.float32(0),
                    uniqueness[y, x] if f_near > 0 else np.float32(0),
                    _bend(maps[k], y, x),
                    _step(maps[k], y, x),
                    np.float32(1) if seen > _NONE and seen < z - 1 else np.float32(0),
                    np.float32(0) if is_seen else np.float32(1),
                    is_hole,
                    is_hole * vote,
                    is_hole * q * (np.float32(1) - residual),
                    unique_around[y, x],
                    disagreement[y, x])
                total = np.float32(0)
                for i in range(len(values)):
                    total += values[i] * table[i]
                odds[k, y, x] = total
                if features.shape[0] > 0:
                    for i in range(len(values)):
                        features[k, y, x, i] = values[i]


@njit(cache=True, nogil=True, inline='always')
def _bend(z, y, x):
    """Mean of both second differences at a pixel, each at most 1 px."""
    height, width = z.shape
    up, down = z[max(y - 1, 0), x], z[min(y + 1, height - 1), x]
    left, right = z[y, max(x - 1, 0)], z[y, min(x + 1, width - 1)]
    twice, one = np.float32(2) * z[y, x], np.float32(1)
    return np.float32(0.5) * (min(abs(up + down - twice), one)
                              + min(abs(left + right - twice), one))


@njit(cache=True, nogil=True, inline='always')
def _step(z, y, x):
    """1 where the map steps between a pixel and those two away, else 0."""
    height, width = z.shape
    here = z[y, x]
    most = max(max(abs(z[max(y - 2, 0), x] - here), abs(z[min(y + 2, height - 1), x] - here)),
               max(abs(z[y, max(x - 2, 0)] - here), abs(z[y, min(x + 2, width - 1)] - here)))
    return np.float32(1) if most > STEP else np.float32(0)


# The order of these sums does not matter, so that they fill vector registers.
@njit(cache=True, nogil=True, fastmath={'contract', 'arcp'}, error_model='numpy')
def _count_votes(y, reach, maps, fine, inside, image, ring, allowed, weight, known, every,
                 agreeing):
    """Weigh the neighbours on a ring by colour, and sum who matched and who agrees."""
    count, _, width = maps.shape
    known[:] = 0
    every[:] = 0
    agreeing[:] = 0
    difference = np.empty(width, np.int16)
    for i in range(ring.shape[0]):
        v, u = y + reach + ring[i, 0], reach + ring[i, 1]
        there, is_inside = fine[v, u:u + width], inside[v, u:u + width]
        difference[:] = 0
        for c in range(image.shape[0]):
            a = image[c, y + reach, reach:reach + width]
            b = image[c, v, u:u + width]
            for x in range(width):
                change = np.int16(np.int16(a[x]) - np.int16(b[x]))
                difference[x] = max(difference[x], max(change, np.int16(-change)))
        for x in range(width):
            d = np.float32(difference[x]) * np.float32(1 / COLOR_SCALE)
            w = is_inside[x] / (np.float32(1) + d * d)
            every[x] += w
            w = w if there[x] > _NONE else np.float32(0)
            known[x] += w
            weight[x] = w
        limit = allowed[i]
        for k in range(count):
            z, sums = maps[k, y], agreeing[k]
            for x in range(width):
                sums[x] += weight[x] if abs(there[x] - z[x]) <= limit else np.float32(0)

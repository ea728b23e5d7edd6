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
import numpy as np

from stereo_refine_ros.refinement.likelihood_kernels import (
    judge_kernel, NONE, roughness_kernel)
from stereo_refine_ros.refinement.likelihood_table import ALONE, PAIR
from stereo_refine_ros.refinement.tuning import (
    AROUND_WINDOW, LOCAL_WINDOW, REACH, REACH_GROWTH, RING)
from stereo_refine_ros.threads import run_bands
from stereo_refine_ros.types import FloatMap, Image

FEATURES = (
    'bias', 'vote', 'around', 'plane_near', 'plane_far', 'plane_residual', 'given_far',
    'smooth_given', 'smooth_ungiven', 'fine_near', 'coarse_far', 'uniqueness', 'bend', 'step',
    'transparent', 'unseen', 'hole', 'hole_vote', 'hole_plane', 'uniqueness_around',
    'disagreement_around')
_COUNT = len(FEATURES)


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
    run_bands(judge_kernel, maps.shape[1], threads, *_arguments(maps, given, planes, evidence),
              table, out, np.empty((0, 0, 0, 0), np.float32))
    return out


def features_at(maps: FloatMap, given: FloatMap, planes: PlaneMap, evidence: Evidence,
                ) -> FloatMap:
    """Return what the model looks at, float32 (K, H, W, F): to fit it."""
    out = np.empty((*maps.shape, _COUNT), np.float32)
    judge_kernel(0, maps.shape[1], *_arguments(maps, given, planes, evidence),
                  np.zeros(_COUNT, np.float32), np.empty_like(maps), out)  # noqa: E127
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
    roughness_kernel(np.ascontiguousarray(values), bend)
    return bend


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
                              cv2.BORDER_CONSTANT, value=float(NONE))
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
    return np.where(np.isnan(values), NONE, values)


def _local_roughness(given: FloatMap) -> FloatMap:
    """Log of the mean bend of the map around every pixel, about -2.6..2."""
    bend = roughness(given)
    known = np.isfinite(bend).astype(np.float32)
    size = (LOCAL_WINDOW, LOCAL_WINDOW)
    total = cv2.blur(np.nan_to_num(bend), size, borderType=cv2.BORDER_REFLECT)
    share = cv2.blur(known, size, borderType=cv2.BORDER_REFLECT)
    return np.log(total / np.maximum(share, np.float32(0.05)) + np.float32(0.01)) + np.float32(2)

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

One logistic model of two dozen numbers answers for every disparity that anybody
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
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.refinement.likelihood_kernels import (
    judge_kernel, NONE, roughness_kernel)
from stereo_refine_ros.refinement.likelihood_table import ALONE, PAIR
from stereo_refine_ros.refinement.tuning import (
    AROUND_WINDOW, LOCAL_WINDOW, MISFIT_WINDOW, REACH, REACH_GROWTH, RING, UNIQUE_WINDOW)
from stereo_refine_ros.threads import run_bands
from stereo_refine_ros.types import FloatMap, Image

FEATURES = (
    'bias', 'vote', 'around', 'plane_near', 'plane_far', 'given_far', 'smooth_given',
    'smooth_ungiven', 'fine_near', 'coarse_far', 'uniqueness', 'bend', 'transparent', 'unseen',
    'hole', 'hole_vote', 'hole_plane', 'hole_behind', 'border', 'border_plane', 'border_behind',
    'uniqueness_around', 'disagreement_around', 'slant', 'misfit')


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
    slant : by how much the disparity changes from pixel to pixel of the image, at most 1
    misfit : by how much the matches around are off their planes, 0..1 px

    """

    values: FloatMap
    quality: FloatMap
    behind: FloatMap
    before: FloatMap
    slant: FloatMap
    misfit: FloatMap


def misfit_around(fine: FloatMap, planes: FloatMap) -> FloatMap:
    """Average over a window by how much matches are off the plane of their segment, 0..1 px."""
    off = np.minimum(np.abs(fine - planes), 1)
    known = np.isfinite(off).astype(np.float32)
    total = _mean(_filled(off, 0.0), MISFIT_WINDOW)
    return total / np.maximum(_mean(known, MISFIT_WINDOW), np.float32(0.05))


@dataclass(frozen=True, eq=False)
class Survey:
    """What the map given and the evidence say around every pixel, laid out for the kernel."""

    image: NDArray[np.uint8]
    inside: FloatMap
    given: FloatMap
    fine: FloatMap
    coarse: FloatMap
    right: FloatMap
    local: FloatMap
    unique_around: FloatMap
    disagreement: FloatMap


def survey(given: FloatMap, evidence: Evidence) -> Survey:
    """Gather what judging needs and no plane changes; `given` as in `log_odds`."""
    reach = int(np.abs(RING).max())
    border = reach, reach, reach, reach
    channels = evidence.image.reshape(*given.shape, -1)
    apart = np.minimum(_filled(np.abs(evidence.fine - evidence.coarse), 1.0), 2)
    return Survey(
        image=np.stack([cv2.copyMakeBorder(np.ascontiguousarray(channels[..., c]), *border,
                                           cv2.BORDER_REPLICATE)
                        for c in range(channels.shape[2])]),
        inside=_inside(given.shape, reach),
        given=_filled(given),
        fine=cv2.copyMakeBorder(_filled(evidence.fine), *border, cv2.BORDER_CONSTANT,
                                value=float(NONE)),
        coarse=_filled(evidence.coarse),
        right=_filled(evidence.right),
        local=_local_roughness(given),
        unique_around=_mean(evidence.uniqueness, UNIQUE_WINDOW),
        disagreement=_mean(apart, AROUND_WINDOW))


def log_odds(maps: FloatMap, given: FloatMap, planes: PlaneMap, evidence: Evidence,
             threads: int = 1, surveyed: Survey | None = None) -> FloatMap:
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
    surveyed : Survey, optional
        Of `given` and `evidence`, where it was made before.

    Returns
    -------
    float32 ndarray of shape (K, H, W)
        Log-odds that each disparity is within 1 px of the truth.

    """
    table = np.array([PAIR if evidence.has_right else ALONE], np.float32)
    out = np.empty((1, *maps.shape), np.float32)
    arguments = _arguments(maps, surveyed or survey(given, evidence), planes, evidence)
    run_bands(judge_kernel, maps.shape[1], threads, *arguments, table, out)
    return out[0]


def features_at(maps: FloatMap, given: FloatMap, planes: PlaneMap, evidence: Evidence,
                ) -> FloatMap:
    """
    Return what the model looks at, float32 (K, H, W, F): to fit it.

    A candidate that is as good as the first is looked at as the first is.
    """
    arguments = _arguments(maps, survey(given, evidence), planes, evidence)
    out = np.empty((len(FEATURES), *maps.shape), np.float32)
    judge_kernel(0, maps.shape[1], *arguments, np.eye(len(FEATURES), dtype=np.float32), out)
    return np.moveaxis(out, 0, -1)


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


def _arguments(maps: FloatMap, known: Survey, planes: PlaneMap, evidence: Evidence,
               ) -> tuple[object, ...]:
    distance = np.hypot(RING[:, 0], RING[:, 1]) * evidence.scale
    allowed = (REACH + REACH_GROWTH * distance).astype(np.float32)
    plane = (_filled(planes.values), planes.quality, _filled(planes.behind), planes.slant,
             planes.misfit)
    return (maps, known.given, plane, known.fine, known.inside, known.coarse,
            evidence.uniqueness, known.right, known.local, known.unique_around,
            known.disagreement, known.image, RING, allowed, evidence.scale)


@lru_cache(maxsize=4)
def _inside(shape: tuple[int, int], reach: int) -> FloatMap:
    """1 inside the image, 0 on a border of `reach` pixels around it."""
    inside = np.zeros((shape[0] + 2 * reach, shape[1] + 2 * reach), np.float32)
    inside[reach:-reach, reach:-reach] = 1
    inside.setflags(write=False)
    return inside


def _filled(values: FloatMap, number: float = float(NONE)) -> FloatMap:
    filled = values.copy()
    cv2.patchNaNs(filled, number)  # several times faster than numpy's `where` and `nan_to_num`
    return filled


def _local_roughness(given: FloatMap) -> FloatMap:
    """Log of the mean bend of the map around every pixel, about -2.6..2."""
    bend = roughness(given)
    known = np.isfinite(bend).astype(np.float32)
    total, share = _mean(_filled(bend, 0.0), LOCAL_WINDOW), _mean(known, LOCAL_WINDOW)
    return np.log(total / np.maximum(share, np.float32(0.05)) + np.float32(0.01)) + np.float32(2)


def _mean(values: FloatMap, window: int) -> FloatMap:
    """Average over a square window, the map mirrored at its borders."""
    return cv2.blur(values, (window, window), borderType=cv2.BORDER_REFLECT).reshape(values.shape)

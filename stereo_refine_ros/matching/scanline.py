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

"""Scanline optimisation on the truncated colour, census and gradient cost."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.matching import scanline_kernels as kernels
from stereo_refine_ros.matching.evidence import Evidence
from stereo_refine_ros.matching.match import Match
from stereo_refine_ros.matching.robust_cost import COST_UNIT, robust_cost_volume
from stereo_refine_ros.params import MatchingParams
from stereo_refine_ros.refinement.consistency import left_right_check
from stereo_refine_ros.threads import run_bands
from stereo_refine_ros.types import DisparityMap, FloatMap, Image, StereoPair

# Penalties in units of cost, and what is left of them where one view or both show an edge.
_P1, _P2 = 2.0, 4.5
_EDGE_FACTORS = (0.1, 0.15, 1.0)
_EDGE_THRESHOLD = 20
# Left and right winners may differ by one step: slanted surfaces do.
_TOLERANCE = 1.0
_ISLAND = 10


def match_scanline(pair: StereoPair, params: MatchingParams, threads: int = 1) -> Match:
    """
    Match by scanline optimisation of the truncated cost.

    `disparity` is sub-pixel and NaN where left and right winners differ by more than a step.
    """
    evidence, winners, subpixel = gather_evidence(pair, params, threads)
    first = np.float32(evidence.min_disparity)
    right = np.where(evidence.right < 0, np.float32(np.nan), evidence.right + first)
    stable = left_right_check(winners + first, right, _TOLERANCE)
    stable &= ~_islands(np.where(stable, winners, -1))
    values = np.where(stable, subpixel + first, np.float32(np.nan))
    disparity = DisparityMap(values, params.min_disparity, params.num_disparities)
    return Match(disparity, right, evidence=evidence)


def gather_evidence(pair: StereoPair, params: MatchingParams, threads: int = 1,
                    ) -> tuple[Evidence, FloatMap, FloatMap]:
    """
    Run four paths over the cost volume of a pair, and take the winners of both views.

    Returns
    -------
    evidence : Evidence
    winners, subpixel : float32 ndarray of shape (H, W)
        Index of the best disparity of the left view, and the same with its parabola offset.

    """
    first, depth = params.min_disparity, params.num_disparities
    cost = robust_cost_volume(pair, first, depth, threads)
    total = _sum_paths(pair, cost, first, depth, threads)
    height, width = pair.shape
    winners, subpixel = np.empty((2, height, width), np.float32)
    least = np.empty((height, width), np.int16)
    right = np.empty((height, width), np.int16)
    run_bands(kernels._winner_kernel, height, threads, total, depth, winners, subpixel, least)
    run_bands(kernels._right_winner_kernel, height, threads, total, first, right)
    return Evidence(total, least, cost, right, first, depth), winners, subpixel


def _sum_paths(pair: StereoPair, cost: NDArray[np.uint8], min_disparity: int, depth: int,
               threads: int) -> NDArray[np.int16]:
    assert pair.right is not None
    height, width, padded = cost.shape
    limits = _limits()
    total = np.empty(cost.shape, np.int16)
    run_bands(kernels._horizontal_kernel, height, threads, cost, depth,
              _flat(pair.left, 1), _mirrored(_flat(pair.right, 1), min_disparity, padded),
              limits, total)
    run_bands(kernels._vertical_kernel, width, threads, cost, depth,
              _flat(pair.left, 0), _mirrored(_flat(pair.right, 0), min_disparity, padded),
              limits, total)
    return total


def _islands(winners: FloatMap) -> NDArray[np.bool_]:
    """Mark matched pixels whose connected region of like disparity is below _ISLAND pixels."""
    # OpenCV's speckle filter works on 16-bit maps; 8 steps leave it room for 4096 disparities.
    steps = (winners * 8).astype(np.int16)
    kept = steps.copy()
    cv2.filterSpeckles(kept, -8, _ISLAND, 8)
    return kept != steps


def _limits() -> NDArray[np.uint8]:
    """P1, what a flat right view adds to it, the same of P2; row 1 for a flat left view."""
    both, one, none = (np.array([_P1, _P2]) * COST_UNIT * factor for factor in _EDGE_FACTORS)
    rows = [(low[0], high[0] - low[0], low[1], high[1] - low[1])
            for low, high in ((both, one), (one, none))]
    return np.rint(rows).astype(np.uint8)


def _flat(image: Image, axis: int) -> NDArray[np.uint8]:
    """Mark with 255 the steps along `axis` that cross no edge; entry i is the step from i - 1."""
    height, width = image.shape[:2]
    flat = np.full((height + 1 - axis, width + axis), 255, np.uint8)
    kernels._flat_kernel(image.reshape(height, width, -1), 1 - axis, _EDGE_THRESHOLD, flat)
    return flat


def _mirrored(flags: NDArray[np.uint8], min_disparity: int, depth: int) -> NDArray[np.uint8]:
    """Mirror columns and pad, so that entry (width - 1 - x) + i is column x - d of `flags`."""
    width = flags.shape[1]
    columns = width - 1 - min_disparity - np.arange(width + depth)
    ahead = int(np.count_nonzero(columns >= width))
    behind = int(np.count_nonzero(columns < 0))
    seen = columns[ahead:len(columns) - behind]
    inside = flags[:, seen[-1]:seen[0] + 1][:, ::-1] if len(seen) else flags[:, :0]
    return np.pad(inside, ((0, 0), (ahead, behind)), mode='constant', constant_values=255)

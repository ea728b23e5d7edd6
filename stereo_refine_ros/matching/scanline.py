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
from stereo_refine_ros.matching.consistency import left_right_check
from stereo_refine_ros.matching.evidence import Evidence
from stereo_refine_ros.matching.match import Match
from stereo_refine_ros.matching.robust_cost import COST_UNIT, matching_features, padded_depth
from stereo_refine_ros.params import MatchingParams
from stereo_refine_ros.threads import run_bands
from stereo_refine_ros.types import DisparityMap, FloatMap, Image, StereoPair

# Penalties P1 and P2 in units of cost, along rows and along columns: floors and tables change
# their disparity from row to row, so a step of one is cheaper there.
_PENALTIES = ((1.75, 4.5), (1.0, 3.5))
# What is left of them where both views show an edge, one does, or none.
_EDGE_FACTORS = (0.1, 0.15, 1.0)
_EDGE_THRESHOLD = 20
# Left and right winners may differ by one step: slanted surfaces do.
_TOLERANCE = 1.0
# Matched regions smaller than one part in this many of the image are chance.
_ISLANDS = 3500


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
    return Match(disparity, evidence=evidence)


def gather_evidence(pair: StereoPair, params: MatchingParams, threads: int = 1,
                    ) -> tuple[Evidence, FloatMap, FloatMap]:
    """
    Run four paths over the cost volume of a pair, and take the winners of both views.

    Returns
    -------
    evidence : Evidence
    winners, subpixel : float32 ndarray of shape (H, W)
        Index of the best disparity of the left view, and the same with its sub-pixel offset.

    """
    height, width = pair.shape
    span = (params.min_disparity, params.num_disparities)
    padded = padded_depth(params.num_disparities)
    cost = np.empty((height, width, padded), np.uint8)
    total = np.empty((height, width, padded), np.int16)
    winners, subpixel = np.empty((2, height, width), np.float32)
    least, right = np.empty((2, height, width), np.int16)
    views = (*matching_features(pair, params.num_disparities),
             _edges(pair, 1, params.min_disparity, padded),
             _edges(pair, 0, params.min_disparity, padded))
    state = _vertical_state(width, params.num_disparities, padded)
    # One direction a thread: each goes to the middle, then on through the other's rows.
    run_bands(kernels.near_half_kernel, 2, threads, views, _limits(), span, (cost, total), state)
    run_bands(kernels.far_half_kernel, 2, threads, views, _limits(), span, (cost, total), state,
              (winners, subpixel, least, right))
    return Evidence(total, least, cost, right, *span), winners, subpixel


def _vertical_state(width: int, depth: int, padded: int) -> tuple[np.ndarray, np.ndarray]:
    """Both vertical paths before their first row: zero at every disparity, walls around."""
    carried = np.full((2, 2, width, padded + 2), kernels.WALL, np.uint8)
    carried[..., 1:depth + 1] = 0
    return carried, np.zeros((2, width), np.uint8)


def _edges(pair: StereoPair, axis: int, min_disparity: int, padded: int,
           ) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Flat steps along an axis, 255 or 0: left (H + 1, W) or (H, W + 1), right mirrored."""
    assert pair.right is not None
    return _flat(pair.left, axis), _mirrored(_flat(pair.right, axis), min_disparity, padded)


def _islands(winners: FloatMap) -> NDArray[np.bool_]:
    """Mark matched pixels whose connected region of like disparity is an island."""
    # OpenCV's speckle filter works on 16-bit maps; 8 steps leave it room for 4096 disparities.
    steps = (winners * 8).astype(np.int16)
    kept = steps.copy()
    cv2.filterSpeckles(kept, -8, winners.size // _ISLANDS, 8)
    return kept != steps


def _limits() -> NDArray[np.uint8]:
    """
    Return P1, what a flat right view adds to it, and the same of P2, uint8 of shape (2, 2, 4).

    By axis, rows first; then for a left view with an edge and for a flat one.
    """
    penalties = np.array(_PENALTIES)[:, np.newaxis] * COST_UNIT
    low = penalties * np.array(_EDGE_FACTORS[:2])[:, np.newaxis]
    high = penalties * np.array(_EDGE_FACTORS[1:])[:, np.newaxis]
    limits = np.stack([low, high - low], axis=-1)  # axis, flatness, P1 or P2, base or rise
    return np.rint(limits.reshape(2, 2, 4)).astype(np.uint8)


def _flat(image: Image, axis: int) -> NDArray[np.uint8]:
    """Mark with 255 the steps along `axis` that cross no edge; entry i is the step from i - 1."""
    height, width = image.shape[:2]
    flat = np.full((height + 1 - axis, width + axis), 255, np.uint8)
    if image.shape[axis] > 1:
        ends = (image[:, 1:], image[:, :-1]) if axis else (image[1:], image[:-1])
        channels = 1 if image.ndim == 2 else image.shape[2]
        flat[1 - axis:height, axis:width] = cv2.inRange(
            cv2.absdiff(*ends), (0,) * channels, (_EDGE_THRESHOLD - 1,) * channels)
    return flat


def _mirrored(flags: NDArray[np.uint8], min_disparity: int, depth: int) -> NDArray[np.uint8]:
    """Mirror columns and pad, so that entry (width - 1 - x) + i is column x - d of `flags`."""
    width = flags.shape[1]
    columns = width - 1 - min_disparity - np.arange(width + depth)
    ahead = int(np.count_nonzero(columns >= width))
    behind = int(np.count_nonzero(columns < 0))
    seen = columns[ahead:len(columns) - behind]
    mirrored = np.full((flags.shape[0], len(columns)), 255, np.uint8)
    if len(seen):
        mirrored[:, ahead:ahead + len(seen)] = flags[:, seen[-1]:seen[0] + 1][:, ::-1]
    return mirrored

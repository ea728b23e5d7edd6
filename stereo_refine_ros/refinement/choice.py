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

"""The choice between candidates: what was given stays, unless another is clearly likelier."""

from __future__ import annotations

import cv2
from numba import njit
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.graph.support import sweep
from stereo_refine_ros.images import to_grey
from stereo_refine_ros.refinement.likelihood import roughness
from stereo_refine_ros.refinement.tuning import (
    ALIKE, MARGIN_GIVEN, MARGIN_HOLE, MARGIN_SLOPE, MARGINS, PLAIN_CONTRAST,
    PLAIN_ODDS, PLAIN_PARTS, SETTLE_SIGMA, VOTE_SIGMA)
from stereo_refine_ros.types import FloatMap, Image


def choose(maps: FloatMap, odds: FloatMap, given: FloatMap, weights: NDArray[np.uint8],
           ) -> NDArray[np.intp]:
    """
    Choose a candidate for every pixel.

    A candidate gains what its log-odds exceed those of the first by. A hole takes the largest
    gain. Where a disparity was given, the largest gain is averaged over the neighbours of like
    colour that were given one and have another candidate too, so that no pixel decides alone; it
    wins if it is above a margin, which is larger where the given map is smooth: a smooth map
    knows more than the evidence against it.

    Parameters
    ----------
    maps, odds : float32 ndarray of shape (K, H, W)
        Candidates, the first what was given, and their log-odds.
    given : float32 ndarray of shape (H, W)
        NaN where nothing was given.
    weights : uint8 ndarray of shape (H, W, 2)
        Edge weights of the image's pixel graph: who counts as a neighbour.

    Returns
    -------
    intp ndarray of shape (H, W), 0..K - 1

    """
    which, gain = np.empty(given.shape, np.intp), np.empty(given.shape, np.float32)
    _best_other_kernel(maps, odds, which, gain)
    is_given = np.isfinite(given)
    mean = _averaged(np.where(is_given, gain, np.float32(-np.inf)), weights)
    is_likelier = np.where(is_given, mean > _margin(given), gain > MARGIN_HOLE)
    return np.where(is_likelier, which, 0)


def settle(odds: FloatMap, weights: NDArray[np.uint8], image: Image) -> FloatMap:
    """
    Let the log-odds of neighbours of like colour count half: errors seldom come alone.

    Where there is nothing to see far around, every disparity fits, and none is likely: in a
    saturated window, a covered lens, a black image.

    Parameters
    ----------
    odds : float32 ndarray of shape (H, W)
        Log-odds of the disparities that were chosen.
    weights : uint8 ndarray of shape (H, W, 2)
        Edge weights of the image's pixel graph.
    image : uint8 ndarray of shape (H, W) or (H, W, 3)
        The left view on the same grid.

    """
    ones = np.ones_like(odds)
    mean = (sweep(odds, weights, SETTLE_SIGMA) + odds) / (
        sweep(ones, weights, SETTLE_SIGMA) + ones)
    return np.float32(0.5) * (odds + mean) - np.float32(PLAIN_ODDS) * _is_plain(image)


def _is_plain(image: Image) -> NDArray[np.bool_]:
    """Whether grey levels hardly differ within a window of a part of the width of the image."""
    grey = to_grey(image).astype(np.float32)
    side = max(3, grey.shape[1] // PLAIN_PARTS) | 1
    mean = cv2.blur(grey, (side, side)).reshape(grey.shape)
    square = cv2.blur(grey * grey, (side, side)).reshape(grey.shape)
    return square - mean * mean < np.float32(PLAIN_CONTRAST ** 2)


def _margin(given: FloatMap) -> float:
    """How much likelier another disparity must be than a given one, in log-odds."""
    bend = roughness(given)
    known = np.isfinite(bend)
    rough = float(np.log(bend[known].mean() + 0.005)) + 2 if known.any() else 0.0
    return float(np.clip(MARGIN_GIVEN - MARGIN_SLOPE * rough, *MARGINS))


@njit(cache=True, nogil=True)
def _best_other_kernel(maps, odds, which, gain):
    """Find the likeliest candidate that differs from the first, and its gain; else -inf."""
    count, height, width = maps.shape
    which[:] = 0
    gain[:] = -np.inf
    for y in range(height):
        for k in range(1, count):
            for x in range(width):
                more = odds[k, y, x] - odds[0, y, x]
                if more > gain[y, x] and abs(maps[k, y, x] - maps[0, y, x]) > ALIKE:
                    which[y, x], gain[y, x] = k, more


def _averaged(gain: FloatMap, weights: NDArray[np.uint8]) -> FloatMap:
    """Mean gain over the neighbours of like colour that have one; -inf where there is none."""
    has_one = np.isfinite(gain)
    count = has_one.astype(np.float32)
    total = np.where(has_one, gain, np.float32(0))
    mean = (sweep(total, weights, VOTE_SIGMA) + total) / (
        sweep(count, weights, VOTE_SIGMA) + count + np.float32(1e-3))
    return np.where(has_one, mean, np.float32(-np.inf))

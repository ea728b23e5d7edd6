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

from stereo_refine_ros.graph.support import mean_of_alike
from stereo_refine_ros.images import to_grey
from stereo_refine_ros.refinement.likelihood import roughness
from stereo_refine_ros.refinement.tuning import (
    ALIKE, MARGIN_GIVEN, MARGIN_HOLE, MARGIN_SLOPE, MARGINS, PLAIN_CONTRAST,
    PLAIN_ODDS, PLAIN_PARTS, SETTLE_SIGMA, VOTE_SIGMA)
from stereo_refine_ros.threads import run_bands, start
from stereo_refine_ros.types import FloatMap, Image


def choose(maps: FloatMap, odds: FloatMap, given: FloatMap, weights: NDArray[np.uint8],
           threads: int = 1) -> NDArray[np.uint8]:
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
    threads : int
        Bands of rows side by side.

    Returns
    -------
    uint8 ndarray of shape (H, W), 0..K - 1

    """
    height = len(given)
    margin = start(threads, _margin, given)
    which = np.empty(given.shape, np.uint8)
    gain, total, count = np.empty((3, *given.shape), np.float32)
    run_bands(_best_other_kernel, height, threads, maps, odds, given, which, gain, total, count)
    mean = mean_of_alike(total, count, weights, VOTE_SIGMA, threads)
    run_bands(_decide_kernel, height, threads, gain, mean, count, given, np.float32(MARGIN_HOLE),
              np.float32(margin.result()), which)
    return which


def take(candidates: FloatMap, which: NDArray[np.uint8], threads: int = 1) -> FloatMap:
    """Pick from candidates, float32 (K, H, W), the one that was chosen at every pixel."""
    taken = np.empty_like(candidates[0])
    run_bands(_take_kernel, len(taken), threads, candidates, which, taken)
    return taken


def settle(odds: FloatMap, weights: NDArray[np.uint8], image: Image,
           threads: int = 1) -> FloatMap:
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
    threads : int
        Bands of rows side by side.

    """
    is_plain = start(threads, _is_plain, image)
    mean = mean_of_alike(odds, np.ones_like(odds), weights, SETTLE_SIGMA, threads)
    return np.float32(0.5) * (odds + mean) - np.float32(PLAIN_ODDS) * is_plain.result()


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
def _best_other_kernel(start, stop, maps, odds, given, which, gain, total, count):
    """
    Find the likeliest candidate that differs from the first, and its gain, -inf where none does.

    `total` and `count` are that gain and 1 at the given pixels that have one, else 0.
    """
    number, _, width = maps.shape
    none = np.float32(-np.inf)
    for y in range(start, stop):
        chosen, best, total_row, count_row, known = which[y], gain[y], total[y], count[y], given[y]
        first, first_odds = maps[0, y], odds[0, y]
        chosen[:] = 0
        best[:] = none
        for k in range(1, number):
            here, here_odds = maps[k, y], odds[k, y]
            for x in range(width):
                more = here_odds[x] - first_odds[x]
                is_better = more > best[x] and abs(here[x] - first[x]) > np.float32(ALIKE)
                best[x] = more if is_better else best[x]
                chosen[x] = np.uint8(k) if is_better else chosen[x]
        for x in range(width):
            has_one = best[x] > none and not np.isnan(known[x])
            total_row[x] = best[x] if has_one else np.float32(0)
            count_row[x] = np.float32(1) if has_one else np.float32(0)


@njit(cache=True, nogil=True)
def _decide_kernel(start, stop, gain, mean, count, given, hole_margin, margin, which):
    for y in range(start, stop):
        for x in range(gain.shape[1]):
            if np.isnan(given[y, x]):
                is_likelier = gain[y, x] > hole_margin
            else:
                is_likelier = count[y, x] > 0 and mean[y, x] > margin
            which[y, x] = which[y, x] if is_likelier else np.uint8(0)


@njit(cache=True, nogil=True)
def _take_kernel(start, stop, candidates, which, taken):
    for y in range(start, stop):
        for x in range(taken.shape[1]):
            taken[y, x] = candidates[which[y, x], y, x]

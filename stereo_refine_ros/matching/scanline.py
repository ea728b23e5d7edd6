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

"""Scanline optimisation on gradients and two censuses, at the resolution of the camera."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.images import to_grey
from stereo_refine_ros.matching.features import feature_planes
from stereo_refine_ros.matching.match import Match
from stereo_refine_ros.matching.scanline_paths import band_kernel
from stereo_refine_ros.matching.tuning import (
    CENSUS_CAP, EDGE_FACTOR, EDGE_STEP, GRADIENT_CAP, ISLANDS, OUT_OF_VIEW, PENALTIES,
    UNIQUENESS_UNIT)
from stereo_refine_ros.matching.vector_steps import LANES_PER_ITEM
from stereo_refine_ros.params import MatchingParams
from stereo_refine_ros.threads import run_bands, start
from stereo_refine_ros.types import DisparityMap, FloatMap, Image, StereoPair

_LANES = (16, 32, 64, 96, 128, 160, 192, 256)
# Fixed, so that the result does not depend on the number of threads.
_BANDS = 4


@dataclass(frozen=True, eq=False)
class Scan:
    """
    What the scanline matcher found in a pair.

    Attributes
    ----------
    disparity : float32 ndarray of shape (H, W)
        Sub-pixel, left view; NaN where both views disagree.
    uniqueness : float32 ndarray of shape (H, W), 0..2
        By how much the winner beats all disparities farther than 2 from it.
    right : float32 ndarray of shape (H, W)
        Disparity that the right view sees at each of its pixels; NaN where no left pixel reaches.

    """

    disparity: FloatMap
    uniqueness: FloatMap
    right: FloatMap


def match_scanline(pair: StereoPair, params: MatchingParams, threads: int = 1) -> Match:
    """
    Match by scanline optimisation.

    `disparity` is sub-pixel and NaN where left and right winners differ by more than a step, and
    in small islands.
    """
    found = scan(pair, params.min_disparity, params.num_disparities, threads)
    values = without_islands(found.disparity)
    return Match(DisparityMap(values, params.min_disparity, params.num_disparities), scan=found)


def scan(pair: StereoPair, min_disparity: int, num_disparities: int, threads: int = 1) -> Scan:
    """
    Match a pair over [min_disparity, min_disparity + num_disparities).

    Raises
    ------
    ValueError
        Without a right image.

    """
    assert pair.right is not None
    height, width = pair.shape
    lanes = next(count for count in _LANES if count >= num_disparities)
    margin = lanes + 2 * width
    right_task = start(threads, feature_planes, to_grey(pair.right), True, margin)
    left = feature_planes(to_grey(pair.left), False, margin)
    mask = np.zeros(lanes, np.uint8)
    mask[num_disparities:] = 255
    subpixel = np.empty((height, width), np.float32)
    least, second = np.empty((2, height, width), np.uint16)
    seen = np.empty((height, width), np.int32)
    args = ((0,) * (lanes // LANES_PER_ITEM), (left, right_task.result(), width), mask,
            np.zeros((1, 1), np.int32), _flat_steps(pair.left),
            ((GRADIENT_CAP, CENSUS_CAP), _penalties(), min_disparity, margin, OUT_OF_VIEW),
            (subpixel, least, second, seen, np.empty(0, np.uint8)))

    def bands(first: int, last: int) -> None:
        for band in range(first, last):
            band_kernel(height * band // _BANDS, height * (band + 1) // _BANDS, *args)
    run_bands(bands, _BANDS, threads)
    lead = second.astype(np.float32) - least
    return Scan(subpixel, np.minimum(lead / np.float32(UNIQUENESS_UNIT), 2),
                np.where(seen < min_disparity, np.nan, seen).astype(np.float32))


def without_islands(disparity: FloatMap) -> FloatMap:
    """Drop matched regions of like disparity that are smaller than a part in ISLANDS."""
    # OpenCV's speckle filter works on 16-bit maps; 8 steps leave it room for 4096 disparities.
    steps = np.where(np.isnan(disparity), -20000, disparity * 8).astype(np.int16)
    kept = steps.copy()
    cv2.filterSpeckles(kept, -20000, disparity.size // ISLANDS, 8)
    return np.where(kept == steps, disparity, np.float32(np.nan))


def _penalties() -> NDArray[np.int32]:
    """P1 and P2, int32 (2, 2, 2): by axis (rows first), then across an edge or not."""
    even = np.array(PENALTIES)
    return np.rint(np.stack([even * EDGE_FACTOR, even], axis=1)).astype(np.int32)


def _flat_steps(image: Image) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Mark with 1 the steps from the left and from above that cross no edge."""
    height, width = image.shape[:2]
    channels = 1 if image.ndim == 2 else image.shape[2]
    flat = np.ones((2, height, width), np.uint8)
    low, high = (0,) * channels, (EDGE_STEP - 1,) * channels
    if width > 1:
        flat[0, :, 1:] = cv2.inRange(cv2.absdiff(image[:, 1:], image[:, :-1]), low, high) & 1
    if height > 1:
        flat[1, 1:] = cv2.inRange(cv2.absdiff(image[1:], image[:-1]), low, high) & 1
    return flat[0], flat[1]

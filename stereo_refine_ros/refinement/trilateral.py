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

"""The joint trilateral filter: weights by space, colour and disparity."""

from __future__ import annotations

from numba import njit
import numpy as np

from stereo_refine_ros.refinement.tuning import TRILATERAL_REACH
from stereo_refine_ros.threads import run_bands
from stereo_refine_ros.types import FloatMap, Image

# Weights are tables: of the sum of channel differences, and of disparity in 1/64 sigma.
_BINS = 64


def trilateral(values: FloatMap, guide: Image, radius: int,
               sigmas: tuple[float, float, float], threads: int = 1) -> FloatMap:
    """
    Average the valid disparities of the window, each weighted by three Gaussians.

    Parameters
    ----------
    values : float32 ndarray of shape (H, W)
        NaN is missing: it weighs nothing and stays NaN.
    guide : uint8 ndarray of shape (H, W) or (H, W, 3)
        The left image.
    radius : int
        Half width of the window, pixels.
    sigmas : tuple of float
        Of colour (mean absolute difference of the channels, grey levels), of space (pixels) and
        of disparity (pixels; from 4 sigma on the weight is 0).
    threads : int
        Bands of rows filtered side by side.

    Returns
    -------
    float32 ndarray of shape (H, W)

    """
    sigma_color, sigma_space, sigma_disparity = sigmas
    channels = guide.reshape(*guide.shape[:2], -1)
    count = channels.shape[2]
    color = _gaussian(np.arange(255 * count + 1) / count, sigma_color)
    line = np.arange(-radius, radius + 1)
    space = _gaussian(np.hypot(line[:, None], line[None, :]), sigma_space)
    steps = int(TRILATERAL_REACH * _BINS)
    disparity = _gaussian(np.arange(steps + 1) / _BINS, 1.0)
    disparity[-1] = 0
    filtered = np.empty_like(values)
    run_bands(_trilateral_kernel, values.shape[0], threads, values, channels,
              (color, space, disparity), np.float32(_BINS / sigma_disparity), filtered)
    return filtered


def _gaussian(distance: np.ndarray, sigma: float) -> FloatMap:
    return np.exp(-0.5 * (distance / sigma) ** 2).astype(np.float32)


@njit(cache=True, nogil=True)
def _trilateral_kernel(start, stop, values, guide, tables, scale, filtered):
    height, width = values.shape
    radius = tables[1].shape[0] // 2
    for y in range(start, stop):
        top, bottom = max(y - radius, 0), min(y + radius + 1, height)
        for x in range(width):
            left, right = max(x - radius, 0), min(x + radius + 1, width)
            offset = (top - y + radius, left - x + radius)
            filtered[y, x] = _average(
                values[top:bottom, left:right], guide[top:bottom, left:right],
                values[y, x], guide[y, x], tables, scale, offset)


@njit(cache=True, nogil=True)
def _average(values, guide, centre, pixel, tables, scale, offset):
    """Return the weighted mean of a window around `centre`, NaN if that is."""
    if np.isnan(centre):
        return centre
    color, space, disparity = tables
    last = np.float32(disparity.size - 1)
    total, weight_sum = np.float32(0), np.float32(0)
    for i in range(values.shape[0]):
        for j in range(values.shape[1]):
            difference = values[i, j] - centre
            steps = abs(difference) * scale
            # A NaN compares as False.
            if not steps < last:
                continue
            distance = 0
            for c in range(pixel.size):
                distance += abs(np.int32(pixel[c]) - np.int32(guide[i, j, c]))
            weight = color[distance] * disparity[int(steps)] \
                * space[offset[0] + i, offset[1] + j]
            total += weight * difference
            weight_sum += weight
    return centre + total / weight_sum

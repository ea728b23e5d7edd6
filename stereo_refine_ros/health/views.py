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

"""What the two images say of their cameras, before anything is matched."""

from __future__ import annotations

import math

import cv2
from numba import njit
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.health import tuning
from stereo_refine_ros.types import Image, PairHealth


def measure_views(left: Image, right: Image) -> PairHealth:
    """
    Measure brightness, noise, sharpness and contrast of a pair.

    Parameters
    ----------
    left, right : uint8 ndarray of shape (H, W)
        Grey, of one shape.

    Returns
    -------
    PairHealth
        `gain_ratio`, `noise_sigma`, `sharpness_ratio`, `saturated_ratio`, `contrast_left`,
        `contrast_right` and `is_same_image`; the rest as it is by default.

    """
    samples = [view[::tuning.EVERY_ROW, ::tuning.EVERY_COLUMN] for view in (left, right)]
    histograms = [np.bincount(sample.ravel(), minlength=256) for sample in samples]
    means, deviations = zip(*(_mean_and_deviation(histogram) for histogram in histograms),
                            strict=True)
    noises = [noise_sigma(view) for view in (left, right)]
    saturated = histograms[0][:tuning.BLACK + 1].sum() + histograms[0][tuning.WHITE:].sum()
    return PairHealth(
        gain_ratio=means[1] / means[0] if means[0] > 0 else math.nan,
        noise_sigma=noises[0],
        sharpness_ratio=_ratio(
            *map(_detail, (left, right), noises, deviations)),
        saturated_ratio=float(saturated / histograms[0].sum()),
        contrast_left=deviations[0], contrast_right=deviations[1],
        is_same_image=deviations[0] >= tuning.PLAIN and np.array_equal(left, right))


def noise_sigma(image: Image) -> float:
    """
    Estimate the sensor noise of a grey image, grey levels; NaN where it is too small or clipped.

    The second difference in both directions (Immerkaer 1996) knows no slopes and few edges;
    the plainest blocks of the image show noise alone. Blocks with clipped pixels are left out.
    """
    sigmas = _block_sigmas(image, tuning.NOISE_BLOCK_PX, tuning.NOISE_EVERY_PX)
    if sigmas.size == 0:
        return math.nan
    return float(np.quantile(sigmas, tuning.NOISE_QUANTILE)) / tuning.NOISE_QUANTILE_OF_SIGMA


def _mean_and_deviation(histogram: NDArray[np.int64]) -> tuple[float, float]:
    levels, total = np.arange(256), histogram.sum()
    mean = float(histogram @ levels / total)
    return mean, math.sqrt(max(float(histogram @ levels ** 2 / total) - mean * mean, 0.0))


def _detail(view: Image, noise: float, contrast: float) -> float:
    """Return the change from pixel to pixel that is not noise, in units of the contrast."""
    rows = np.ascontiguousarray(view[::tuning.EVERY_ROW])
    # The second difference along the row, of which white noise has six times its variance.
    fine = cv2.filter2D(rows, cv2.CV_16S, np.array([[-1.0, 2.0, -1.0]]))
    power = cv2.norm(fine, cv2.NORM_L2SQR) / fine.size
    if math.isfinite(noise):
        power -= 6 * noise * noise
    return math.sqrt(max(power, 0.0)) / contrast if contrast >= tuning.PLAIN else math.nan


def _ratio(first: float, second: float) -> float:
    """Return the smaller over the larger, NaN where one is unknown or both are 0."""
    larger = max(first, second)
    is_known = larger > 0 and not math.isnan(first + second)
    return min(first, second) / larger if is_known else math.nan


@njit(cache=True, nogil=True)
def _block_sigmas(image, side, every):
    """Return the noise of blocks over the image, grey levels, float64 (N,)."""
    height, width = image.shape
    out = np.empty((height // every + 1) * (width // every + 1))
    count = 0
    for top in range(1, height - side, every):
        for left in range(1, width - side, every):
            total = 0
            is_clipped = False
            for y in range(top, top + side):
                above, here, below = image[y - 1], image[y], image[y + 1]
                for x in range(left, left + side):
                    is_clipped |= here[x] == 0 or here[x] == 255
                    edge = (np.int32(above[x - 1]) + np.int32(above[x + 1])
                            + np.int32(below[x - 1]) + np.int32(below[x + 1]))
                    cross = (np.int32(above[x]) + np.int32(below[x])
                             + np.int32(here[x - 1]) + np.int32(here[x + 1]))
                    total += abs(edge - 2 * cross + 4 * np.int32(here[x]))
            if not is_clipped:
                out[count] = math.sqrt(math.pi / 2) / 6 * total / (side * side)
                count += 1
    return out[:count]

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
Step 4c: the filter of the disparity map, chosen by name from `FILTERS`.

Every filter is a function `filter(values, guide, params, threads) -> values`. NaN is missing in
all of them: it has no part in any neighbour's result, and a hole stays a hole.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

from stereo_refine_ros.images import to_grey
from stereo_refine_ros.params import FilterParams
from stereo_refine_ros.refinement.trilateral import trilateral
from stereo_refine_ros.refinement.weighted_median import weighted_median
from stereo_refine_ros.threads import run_bands
from stereo_refine_ros.types import FloatMap, Image

Filter = Callable[[FloatMap, Image, FilterParams, int], FloatMap]


def apply_filter(values: FloatMap, guide: Image, params: FilterParams,
                 threads: int = 1) -> FloatMap:
    """
    Filter a disparity map with the filter that `params.method` names.

    Parameters
    ----------
    values : float32 ndarray of shape (H, W)
        Pixels, NaN invalid; not changed.
    guide : uint8 ndarray of shape (H, W) or (H, W, 3)
        The left image.
    params : FilterParams
        Method, radius and sigmas.
    threads : int
        Bands of rows filtered side by side.

    Raises
    ------
    ValueError
        For an unknown method or a guide of another size.

    """
    if params.method not in FILTERS:
        raise ValueError(f'filter.method: {params.method!r} is none of {", ".join(FILTERS)}')
    if guide.shape[:2] != values.shape:
        raise ValueError(f'guide: expected shape {values.shape}, got {guide.shape[:2]}')
    return FILTERS[params.method](values, guide, params, threads)


def _none(values: FloatMap, guide: Image, params: FilterParams, threads: int = 1) -> FloatMap:
    return values.copy()


def _box(values: FloatMap, guide: Image, params: FilterParams, threads: int = 1) -> FloatMap:
    """Average the valid disparities of the window."""
    valid = np.isfinite(values)
    mean = _WindowMean(valid, params.radius)
    return _with_holes(mean(values), valid)


def _median(values: FloatMap, guide: Image, params: FilterParams, threads: int = 1) -> FloatMap:
    """Take the median: OpenCV's where it can, else the weighted one with equal weights."""
    if params.radius <= 2 and np.isfinite(values).all():
        out = np.empty_like(values)
        run_bands(_median_rows, len(values), threads, values, params.radius, out)
        return out
    return weighted_median(values, guide, params.radius, np.inf, np.inf, threads)


def _median_rows(start: int, stop: int, values: FloatMap, radius: int, out: FloatMap) -> None:
    first = max(start - radius, 0)
    medians = cv2.medianBlur(values[first:stop + radius], 2 * radius + 1)
    out[start:stop] = medians.reshape(-1, values.shape[1])[start - first:stop - first]


def _weighted_median(values: FloatMap, guide: Image, params: FilterParams,
                     threads: int = 1) -> FloatMap:
    return weighted_median(
        values, guide, params.radius, params.sigma_color, params.sigma_space, threads)


def _bilateral(values: FloatMap, guide: Image, params: FilterParams, threads: int = 1) -> FloatMap:
    """Smooth by space and disparity, without the image: OpenCV's bilateral filter."""
    valid = np.isfinite(values)
    if not valid.any():
        return values.copy()
    # Holes lie so far below every disparity that their weight is exp(-32).
    far = values[valid].min() - 8.0 * params.sigma_disparity
    filled = np.where(valid, values, np.float32(far))
    size = 2 * params.radius + 1
    smooth = cv2.bilateralFilter(filled, size, params.sigma_disparity, params.sigma_space)
    return _with_holes(smooth, valid)


def _trilateral(values: FloatMap, guide: Image, params: FilterParams,
                threads: int = 1) -> FloatMap:
    return trilateral(values, guide, params.radius,
                      (params.sigma_color, params.sigma_space, params.sigma_disparity), threads)


def _guided(values: FloatMap, guide: Image, params: FilterParams, threads: int = 1) -> FloatMap:
    """
    Fit the disparity linearly to the grey guide (0..1) in every window [He et al. 2013].

    All window means are over valid pixels only.
    """
    valid = np.isfinite(values)
    mean = _WindowMean(valid, params.radius)
    level: FloatMap = np.divide(to_grey(guide), 255, dtype=np.float32)
    # Around their mean, float32 keeps the digits that the covariance needs.
    offset = np.float32(np.nanmean(values)) if valid.any() else np.float32(0)
    centred: FloatMap = values - offset
    mean_level, mean_value = mean(level), mean(centred)
    variance = mean(level * level) - mean_level * mean_level
    covariance = mean(level * centred) - mean_level * mean_value
    slope: FloatMap = covariance / (variance + np.float32(params.eps))
    intercept = mean_value - slope * mean_level
    return _with_holes(mean(slope) * level + mean(intercept) + offset, valid)


class _WindowMean:
    """The mean of a map over the valid pixels of a square window."""

    def __init__(self, valid: np.ndarray, radius: int) -> None:
        self._size = (2 * radius + 1, 2 * radius + 1)
        self._valid = valid
        self._count = self._sum(valid.astype(np.float32))

    def __call__(self, values: FloatMap) -> FloatMap:
        """Return the mean; anything where the window has no valid pixel."""
        return self._sum(np.where(self._valid, values, np.float32(0))) \
            / np.maximum(self._count, np.float32(1))

    def _sum(self, values: FloatMap) -> FloatMap:
        return cv2.boxFilter(
            values, cv2.CV_32F, self._size, normalize=False, borderType=cv2.BORDER_CONSTANT)


def _with_holes(values: FloatMap, valid: np.ndarray) -> FloatMap:
    return np.where(valid, values, np.float32(np.nan)).astype(np.float32)


FILTERS: dict[str, Filter] = {
    'none': _none,
    'box': _box,
    'weighted_median': _weighted_median,
    'guided': _guided,
    'trilateral': _trilateral,
    'bilateral': _bilateral,
    'median': _median,
}

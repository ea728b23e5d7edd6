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

"""Errors of a disparity map in pixels, against known ground truth."""

from __future__ import annotations

from dataclasses import dataclass
import math

import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.types import FloatMap

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class DisparityErrors:
    """
    Errors over the pixels with known truth (and inside a mask, where one was given).

    All are NaN where there is nothing to count.

    Attributes
    ----------
    bad_0_5, bad_1_0, bad_2_0, bad_3_0 : float
        Percent of those pixels that are off by more than 0.5, 1, 2, 3 px. A hole counts as bad.
    avg_error : float
        Mean absolute error in pixels over those of them that are valid.
    density : float
        Share of valid ones among them, 0..1.

    """

    bad_0_5: float
    bad_1_0: float
    bad_2_0: float
    bad_3_0: float
    avg_error: float
    density: float


def measure_errors(values: FloatMap, truth: FloatMap, mask: Mask | None = None
                   ) -> DisparityErrors:
    """
    Compare disparities with the truth.

    Parameters
    ----------
    values, truth : float32 ndarray of shape (H, W)
        Pixels, NaN invalid and unknown.
    mask : bool ndarray of shape (H, W), optional
        Pixels that count, among those with known truth.

    Raises
    ------
    ValueError
        For shapes that differ.

    """
    error = _errors(values, truth, mask)
    valid = error[np.isfinite(error)]
    return DisparityErrors(
        _bad_percent(error, 0.5), _bad_percent(error, 1.0), _bad_percent(error, 2.0),
        _bad_percent(error, 3.0),
        float(np.mean(valid, dtype=np.float64)) if valid.size else math.nan,
        valid.size / error.size if error.size else math.nan)


def bad_percent(values: FloatMap, truth: FloatMap, threshold: float,
                mask: Mask | None = None) -> float:
    """
    Percent of known pixels (inside `mask`) that are off by more than `threshold` px.

    The comparison is strict, `|d - t| > threshold`; a hole counts as bad. NaN without pixels.
    """
    return _bad_percent(_errors(values, truth, mask), threshold)


def _errors(values: FloatMap, truth: FloatMap, mask: Mask | None) -> FloatMap:
    if values.shape != truth.shape or (mask is not None and mask.shape != truth.shape):
        raise ValueError(
            f'expected one shape, got disparity {values.shape}, truth {truth.shape}'
            + ('' if mask is None else f', mask {mask.shape}'))
    counted = np.isfinite(truth)
    if mask is not None:
        counted &= mask
    return np.abs(values[counted] - truth[counted])


def _bad_percent(error: FloatMap, threshold: float) -> float:
    if not error.size:
        return math.nan
    # Not "error > threshold": a hole's error is NaN and has to count as bad.
    return 100.0 * (1.0 - np.count_nonzero(error <= threshold) / error.size)

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
How well a confidence tells right disparities from wrong ones, and whether its numbers are true.

Sparsification (Hu & Mordohai 2012; Poggi et al. 2021): remove the least sure pixels first and
look at the share of wrong ones among those that remain. Calibration: of the pixels called 0.9,
nine in ten should be right.
"""

from __future__ import annotations

from dataclasses import dataclass
import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stereo_refine_ros.types import FloatMap

Flags = NDArray[np.bool_]
Series = NDArray[np.float64]

SURE = 0.9  # what counts as sure
ERROR_LIMIT = 0.05  # share of wrong pixels that `density_at_error` allows
BINS = 10  # of the reliability diagram


@dataclass(frozen=True, eq=False)
class Reliability:
    """
    Bins of the reliability diagram, from the least sure to the surest.

    Attributes
    ----------
    share : float64 ndarray of shape (B,)
        Share of all pixels in the bin, 0..1.
    predicted : float64 ndarray of shape (B,)
        Mean confidence in the bin, NaN where it is empty.
    observed : float64 ndarray of shape (B,)
        Share of right pixels in the bin, NaN where it is empty.

    """

    share: Series
    predicted: Series
    observed: Series

    @property
    def calibration_error(self) -> float:
        """Mean of |observed - predicted| over the pixels (expected calibration error)."""
        filled = self.share > 0
        if not filled.any():
            return math.nan
        return float(np.sum(self.share[filled] * np.abs(
            self.observed[filled] - self.predicted[filled])))


@dataclass(frozen=True)
class ConfidenceQuality:
    """
    What a confidence is worth on one map; NaN where no pixel counts.

    Attributes
    ----------
    confidence_area : float
        Area under the sparsification curve, 0..1: mean share of wrong pixels over densities.
    confidence_area_best : float
        The least area that any order of these pixels has.
    calibration_error : float
        Mean difference of what is promised and what is kept, 0..1.
    density_at_5 : float
        Share of pixels that can be kept with at most 5 % of them wrong.
    sure_share : float
        Share of pixels at 0.9 and above.
    sure_wrong : float
        Share of wrong ones among these; NaN where there are none.

    """

    confidence_area: float
    confidence_area_best: float
    calibration_error: float
    density_at_5: float
    sure_share: float
    sure_wrong: float


def measure_confidence(confidence: FloatMap, values: FloatMap, truth: FloatMap,
                       threshold: float = 1.0, mask: Flags | None = None
                       ) -> ConfidenceQuality:
    """
    Measure a confidence over the pixels with known truth.

    Parameters
    ----------
    confidence : float32 ndarray of shape (H, W), 0..1
        NaN counts as 0.
    values, truth : float32 ndarray of shape (H, W)
        Pixels, NaN invalid and unknown; an invalid disparity is wrong.
    threshold : float
        Pixels; what is off by more is wrong.
    mask : bool ndarray of shape (H, W), optional
        Pixels that count, among those with known truth.

    Raises
    ------
    ValueError
        For shapes that differ.

    """
    sure, wrong = judged_pixels(confidence, values, truth, threshold, mask)
    curve, is_sure = sparsification_curve(sure, wrong), sure >= SURE
    return ConfidenceQuality(
        area(curve), best_area(int(np.count_nonzero(wrong)), wrong.size),
        reliability(sure, wrong).calibration_error, density_at_error(curve),
        _share(is_sure), _share(wrong[is_sure]))


def judged_pixels(confidence: FloatMap, values: FloatMap, truth: FloatMap,
                  threshold: float = 1.0, mask: Flags | None = None
                  ) -> tuple[FloatMap, Flags]:
    """
    Return the confidence of every pixel that counts, and whether its disparity is wrong.

    Parameters, errors: as `measure_confidence`.

    Returns
    -------
    confidence : float32 ndarray of shape (N,)
    wrong : bool ndarray of shape (N,)

    """
    if not confidence.shape == values.shape == truth.shape or (
            mask is not None and mask.shape != truth.shape):
        raise ValueError(
            f'expected one shape, got confidence {confidence.shape}, disparity {values.shape}, '
            f'truth {truth.shape}' + ('' if mask is None else f', mask {mask.shape}'))
    counted = np.isfinite(truth) if mask is None else np.isfinite(truth) & mask
    # Not "error > threshold": a hole's error is NaN and has to count as wrong.
    wrong = ~(np.abs(values[counted] - truth[counted]) <= threshold)
    return np.nan_to_num(confidence[counted], nan=0.0), wrong


def sparsification_curve(confidence: ArrayLike, wrong: ArrayLike) -> Series:
    """
    Share of wrong pixels among the k surest, for every k.

    Pixels of one confidence have no order among themselves: their errors are spread evenly over
    them, as a mean over all orders has it.

    Parameters
    ----------
    confidence : array of shape (N,)
        Of each pixel, 0..1.
    wrong : bool array of shape (N,)
        Whether its disparity is wrong.

    Returns
    -------
    float64 ndarray of shape (N,)
        Entry k - 1 is of the k surest; the last is the share of all.

    """
    confidence, wrong = np.asarray(confidence), np.asarray(wrong, bool)
    if confidence.size == 0:
        return np.zeros(0)
    order = np.argsort(-confidence, kind='stable')
    ordered = confidence[order]
    ends = np.append(np.flatnonzero(np.diff(ordered)) + 1, ordered.size)
    kept = np.arange(1, ordered.size + 1)
    wrong_to_end = np.cumsum(wrong[order])[ends - 1]
    return np.interp(kept, np.append(0, ends), np.append(0, wrong_to_end)) / kept


def area(curve: Series) -> float:
    """Mean of a sparsification curve over its densities, 0..1; NaN without pixels."""
    return float(np.mean(curve)) if curve.size else math.nan


def best_area(wrong: int, count: int) -> float:
    """Area of the curve that removes every wrong pixel before the first right one."""
    if count == 0:
        return math.nan
    kept = np.arange(count - wrong + 1, count + 1)  # from here on wrong ones remain
    return float(np.sum((kept - (count - wrong)) / kept)) / count


def density_at_error(curve: Series, limit: float = ERROR_LIMIT) -> float:
    """Largest share of pixels, the surest, of which at most `limit` are wrong; 0 where none."""
    if not curve.size:
        return math.nan
    allowed = np.flatnonzero(curve <= limit)
    return (int(allowed[-1]) + 1) / curve.size if allowed.size else 0.0


def reliability(confidence: ArrayLike, wrong: ArrayLike, bins: int = BINS) -> Reliability:
    """
    Compare promised and kept in bins of equal width over 0..1; 1 is in the last bin.

    Parameters
    ----------
    confidence : array of shape (N,)
        Of each pixel, 0..1.
    wrong : bool array of shape (N,)
        Whether its disparity is wrong.
    bins : int
        How many.

    """
    confidence = np.asarray(confidence)  # its own precision: a float32 0.9 is in the last bin
    number = np.clip((confidence * bins).astype(np.int64), 0, bins - 1)
    count = np.bincount(number, minlength=bins)
    promised = np.bincount(number, confidence, bins)
    kept = np.bincount(number, ~np.asarray(wrong, bool), bins)
    with np.errstate(invalid='ignore'):  # an empty bin is 0 / 0, NaN
        return Reliability(count / max(confidence.size, 1), promised / count, kept / count)


def _share(flags: Flags) -> float:
    return float(np.count_nonzero(flags)) / flags.size if flags.size else math.nan

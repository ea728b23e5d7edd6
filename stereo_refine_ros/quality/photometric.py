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
Quality without ground truth: the right view, warped by the disparity, against the left.

Two maps are compared over the same pixels, those that both know and that the right view shows.
Cameras differ in exposure, so gain and offset are fitted first; and a pixel at an outline sees
two surfaces and fits no disparity, so a residual counts only up to a few times their spread.
"""

from __future__ import annotations

from dataclasses import dataclass
import math

from numba import njit
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.quality.image_metrics import psnr, ssim
from stereo_refine_ros.types import FloatMap, Image, StereoPair

Mask = NDArray[np.bool_]
Series = NDArray[np.float64]

# Shares of the robust spread of the residuals: what takes part in the fit of the exposure, and
# where a residual is cut. Truth then beats SGBM's map in the lab (test/evaluation); uncut, it
# does on Venus alone, because the outlines' mixed pixels decide.
_FIT_SPREADS, _CUT_SPREADS = 2.5, 3.0
_LEAST_SPREAD = 1.0  # grey levels, about what rounding to 8 bits makes
_FIT_PASSES = 4
_SPREAD_OF_MEDIAN = 1.4826  # standard deviation of a normal distribution, in medians of |r|
_COVERED_PX = 2.0  # what is nearer than this covers; a surface that slants up to a half does not


@dataclass(frozen=True)
class Photometric:
    """PSNR in dB and SSIM of the compensated right view against the left."""

    psnr: float
    ssim: float


@dataclass(frozen=True)
class Exposure:
    """
    What turns grey levels of the right view into those of the left: gain * level + offset.

    `spread` is the robust standard deviation of what remains, in grey levels.
    """

    gain: float
    offset: float
    spread: float

    def apply(self, warped: Image) -> FloatMap:
        """Compensate a view; float32 of its shape."""
        return np.float32(self.gain) * warped + np.float32(self.offset)


def compare_photometric(pair: StereoPair, before: FloatMap, after: FloatMap
                        ) -> tuple[Photometric, Photometric]:
    """
    Measure two maps of one pair over the same pixels.

    These are the pixels that are valid in both maps, whose matches lie inside the right view,
    and that the right view shows, by the second map: nothing nearer covers them.

    Parameters
    ----------
    pair : StereoPair
        Colour is compared in grey.
    before, after : float32 ndarray of shape (H, W)
        Pixels, NaN invalid.

    Returns
    -------
    before, after : Photometric
        NaN without a right image or without such a pixel.

    """
    nothing = Photometric(math.nan, math.nan)
    if pair.right is None:
        return nothing, nothing
    left, right = pair.left_grey, pair.right_grey
    (first, first_seen), (second, second_seen) = (
        warp_right(right, values) for values in (before, after))
    counted = first_seen & second_seen & visible_pixels(after)
    if not counted.any():
        return nothing, nothing
    exposure = fit_exposure(np.concatenate([left[counted]] * 2),
                            np.concatenate([first[counted], second[counted]]))
    return (_quality(left, first, counted, exposure), _quality(left, second, counted, exposure))


def fit_exposure(left: Image, right: Image) -> Exposure:
    """
    Fit gain and offset between matched grey levels, whatever a few wrong matches say.

    Least squares over the residuals that are no outliers, a few times. Levels that hardly vary
    say nothing of the gain: then only an offset is fitted.

    Parameters
    ----------
    left, right : uint8 ndarray of shape (N,)
        Grey levels of the same points.

    """
    # A cell for every pair of levels that occurs: there are fewer of them than pixels.
    counts = np.bincount(right.astype(np.int64) * 256 + left, minlength=256 * 256)
    cells = np.flatnonzero(counts)
    weight = counts[cells].astype(np.float64)
    x, y = (cells // 256).astype(np.float64), (cells % 256).astype(np.float64)
    gain, offset = 1.0, _weighted_median(y - x, weight)
    spread = _spread(y - x - offset, weight)
    for _ in range(_FIT_PASSES):
        kept = np.where(np.abs(y - gain * x - offset) <= _FIT_SPREADS * spread, weight, 0.0)
        mean_x, mean_y = np.average(x, weights=kept), np.average(y, weights=kept)
        variance = np.average((x - mean_x) ** 2, weights=kept)
        gain = 1.0 if variance < _LEAST_SPREAD else float(
            np.average((x - mean_x) * (y - mean_y), weights=kept) / variance)
        offset = float(mean_y - gain * mean_x)
        spread = _spread(y - gain * x - offset, weight)
    return Exposure(gain, offset, spread)


def visible_pixels(values: FloatMap) -> Mask:
    """
    Find the pixels that the right view shows: no nearer surface stands at their match.

    Parameters
    ----------
    values : float32 ndarray of shape (H, W)
        Disparity of the left view in pixels, NaN invalid.

    Returns
    -------
    bool ndarray of shape (H, W)
        False too where the disparity is invalid or its match outside the right view.

    """
    out = np.zeros(values.shape, np.bool_)
    _visible_kernel(np.require(values, requirements=['C', 'W']), out)
    return out


@njit(cache=True, nogil=True)
def _visible_kernel(values, out):
    height, width = values.shape
    nearest = np.empty(width + 2, np.float32)  # disparity by column of the right view, from -1
    for y in range(height):
        nearest[:] = -np.inf
        for x in range(width):
            column = np.float32(x) - values[y, x]
            if 0 <= column <= width - 1:
                at = int(column + np.float32(0.5)) + 1
                nearest[at] = max(nearest[at], values[y, x])
        for x in range(width):
            column = np.float32(x) - values[y, x]
            if 0 <= column <= width - 1:
                at = int(column + np.float32(0.5)) + 1
                # The neighbours too: the match lies between two columns.
                front = max(nearest[at - 1], nearest[at], nearest[at + 1])
                out[y, x] = values[y, x] >= front - _COVERED_PX


def warp_right(right: Image, values: FloatMap) -> tuple[Image, NDArray[np.bool_]]:
    """
    Fetch for every left pixel (x, y) the right view at (x - d, y), linearly along x.

    Parameters
    ----------
    right : uint8 ndarray of shape (H, W)
        Grey right view.
    values : float32 ndarray of shape (H, W)
        Disparity of the left view in pixels, NaN invalid.

    Returns
    -------
    warped : uint8 ndarray of shape (H, W)
        Rounded to whole grey levels; 0 where nothing was fetched.
    seen : bool ndarray of shape (H, W)
        Valid pixels whose match lies inside the right image.

    """
    warped = np.zeros(values.shape, np.uint8)
    seen = np.zeros(values.shape, np.bool_)
    _warp_kernel(np.require(right, requirements=['C', 'W']),
                 np.require(values, requirements=['C', 'W']), warped, seen)
    return warped, seen


@njit(cache=True, nogil=True)
def _warp_kernel(right, values, warped, seen):
    height, width = values.shape
    for y in range(height):
        for x in range(width):
            column = np.float32(x) - values[y, x]
            if not 0 <= column <= width - 1:  # also where it is NaN
                continue
            first = int(column)
            share = column - np.float32(first)
            near = np.float32(right[y, first])
            far = np.float32(right[y, min(first + 1, width - 1)])
            warped[y, x] = np.uint8(near + share * (far - near) + np.float32(0.5))
            seen[y, x] = True


def _quality(left: Image, warped: Image, counted: Mask, exposure: Exposure) -> Photometric:
    cut = _CUT_SPREADS * exposure.spread
    residual = np.clip(left - exposure.apply(warped), -cut, cut)
    test = np.clip(np.rint(left - residual), 0, 255).astype(np.uint8)
    return Photometric(psnr(left, test, counted), ssim(left, test, counted))


def _spread(residual: Series, weight: Series) -> float:
    return max(_SPREAD_OF_MEDIAN * _weighted_median(np.abs(residual), weight), _LEAST_SPREAD)


def _weighted_median(values: Series, weight: Series) -> float:
    """Count instead of sorting, to a quarter of a grey level."""
    steps = np.rint(values * 4).astype(np.int64)
    first = int(steps.min())
    total = np.cumsum(np.bincount(steps - first, weight))
    return (int(np.searchsorted(total, total[-1] / 2)) + first) / 4

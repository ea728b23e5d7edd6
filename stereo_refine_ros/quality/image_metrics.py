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
MSE, PSNR and SSIM of 8-bit maps (Hamzah et al. 2017, equations 5-10).

A mask says which pixels count. Maps of disparity become 8-bit by `to_8bit`, at the scale of
their data set; what is unknown or invalid there is 0, as in the paper's pictures.
"""

from __future__ import annotations

import math

import cv2
from numba import njit
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.types import FloatMap, Image

Mask = NDArray[np.bool_]

_PEAK = 255.0
_C1 = np.float32((0.01 * _PEAK) ** 2)
_C2 = np.float32((0.03 * _PEAK) ** 2)
_SIGMA = 1.5
_BAND = 64  # rows
_RADIUS = 5  # 3.5 sigma, the 11 x 11 window of Wang et al. 2004
_OFFSET = np.float32(128)  # variances do not shift; small values keep float32 exact enough


def to_8bit(values: FloatMap, scale: float) -> NDArray[np.uint8]:
    """
    Turn disparities into grey levels: `values * scale`, rounded half to even, cut to 0..255.

    Parameters
    ----------
    values : float32 ndarray of shape (H, W)
        Pixels, NaN invalid; NaN becomes 0.
    scale : float
        Grey levels per pixel of disparity.

    """
    levels = np.rint(np.nan_to_num(values, nan=0.0) * np.float32(scale))
    return np.clip(levels, 0, 255).astype(np.uint8)


def default_scale(num_disparities: int) -> float:
    """
    Choose grey levels per pixel where a data set has no 8-bit scale of its own.

    The largest whole number that keeps `num_disparities` within 8 bits, so 4 for 60 and 3 for
    73; above 255 disparities the fraction that just fits.
    """
    if num_disparities < 1:
        raise ValueError(f'num_disparities: expected at least 1, got {num_disparities}')
    return float(255 // num_disparities) if num_disparities <= 255 else 255.0 / num_disparities


def mse(reference: Image, test: Image, mask: Mask | None = None) -> float:
    """
    Mean squared difference of two 8-bit maps over the pixels of `mask` (equation 5).

    Returns NaN where the mask holds no pixel.
    """
    reference, test, mask = _checked(reference, test, mask)
    total, count = _squared_difference_kernel(reference, test, mask)
    return total / count if count else math.nan


def psnr(reference: Image, test: Image, mask: Mask | None = None) -> float:
    """Peak signal-to-noise ratio in dB over the pixels of `mask` (equation 6), inf at MSE 0."""
    return psnr_from_mse(mse(reference, test, mask))


def psnr_from_mse(error: float) -> float:
    """Turn a mean squared error of 8-bit maps into dB; 0 gives inf, NaN stays NaN."""
    return math.inf if error == 0 else 10.0 * math.log10(_PEAK ** 2 / error)


def ssim(reference: Image, test: Image, mask: Mask | None = None) -> float:
    """
    Mean structural similarity of two 8-bit maps over the pixels of `mask` (equations 7-10).

    Outside the mask `test` is set to `reference` first: an unknown pixel says nothing for or
    against its neighbours, whose windows reach it. The outer 5 pixels, where the window leaves
    the image, do not count (as in Wang et al. 2004 and scikit-image), unless nothing else is
    left. Returns NaN where the mask holds no pixel.
    """
    reference, test, mask = _checked(reference, test, mask)
    similarity = _ssim_map(reference, test, mask)
    total, count = _masked_sum_kernel(similarity, mask, _RADIUS)
    if count == 0:
        total, count = _masked_sum_kernel(similarity, mask, 0)
    return total / count if count else math.nan


def ssim_map(reference: Image, test: Image, mask: Mask | None = None) -> FloatMap:
    """
    Structural similarity at every pixel, Gaussian window of sigma 1.5, population variances.

    With C3 = C2 / 2 the product l c s of equations 8-10 is
    (2 mu_r mu_t + C1) (2 s_rt + C2) / ((mu_r^2 + mu_t^2 + C1) (s_r^2 + s_t^2 + C2)).
    Outside `mask`, `test` is taken to equal `reference`.
    """
    return _ssim_map(*_checked(reference, test, mask))


def _ssim_map(reference: Image, test: Image, mask: Mask) -> FloatMap:
    out = np.empty(reference.shape, np.float32)
    height, width = reference.shape
    for top in range(0, height, _BAND):
        # A few rows at a time stay in the cache: twice as fast as whole images.
        first, last = max(0, top - _RADIUS), min(height, top + _BAND + _RADIUS)
        moments = np.empty((4, last - first, width), np.float32)
        _moments_kernel(reference[first:last], test[first:last], mask[first:last], moments)
        for moment in moments:
            cv2.GaussianBlur(moment, (2 * _RADIUS + 1,) * 2, _SIGMA, dst=moment,
                             borderType=cv2.BORDER_REFLECT)
        _similarity_kernel(moments, top - first, out[top:top + _BAND])
    return out


@njit(cache=True, nogil=True)
def _squared_difference_kernel(reference, test, mask):
    total, count = np.int64(0), 0
    for y in range(reference.shape[0]):
        for x in range(reference.shape[1]):
            if mask[y, x]:
                # int32 first: the difference of two uint8 would wrap round.
                difference = np.int32(reference[y, x]) - np.int32(test[y, x])
                total += difference * difference
                count += 1
    return total, count


@njit(cache=True, nogil=True)
def _moments_kernel(reference, test, mask, moments):
    for y in range(reference.shape[0]):
        for x in range(reference.shape[1]):
            a = np.float32(reference[y, x]) - _OFFSET
            b = np.float32(test[y, x]) - _OFFSET if mask[y, x] else a
            moments[0, y, x], moments[1, y, x] = a, b
            moments[2, y, x], moments[3, y, x] = a * a + b * b, a * b


@njit(cache=True, nogil=True)
def _similarity_kernel(moments, skip, out):
    two = np.float32(2)
    for y in range(out.shape[0]):
        for x in range(out.shape[1]):
            a, b = moments[0, skip + y, x], moments[1, skip + y, x]
            spread = moments[2, skip + y, x] - a * a - b * b
            covariance = moments[3, skip + y, x] - a * b
            a, b = a + _OFFSET, b + _OFFSET
            luminance = (two * a * b + _C1) / (a * a + b * b + _C1)
            out[y, x] = luminance * (two * covariance + _C2) / (spread + _C2)


@njit(cache=True, nogil=True)
def _masked_sum_kernel(values, mask, border):
    total, count = 0.0, 0
    for y in range(border, values.shape[0] - border):
        for x in range(border, values.shape[1] - border):
            if mask[y, x]:
                total += values[y, x]
                count += 1
    return total, count


def _checked(reference: Image, test: Image, mask: Mask | None) -> tuple[Image, Image, Mask]:
    """Check the maps and return them as the kernels want them; no mask is all pixels."""
    for name, image in (('reference', reference), ('test', test)):
        if image.dtype != np.uint8 or image.shape != reference.shape[:2]:
            raise ValueError(f'{name}: expected uint8 (H, W) of one shape, got {image.dtype} '
                             f'{image.shape} beside {reference.shape}')
    if mask is None:
        mask = np.ones(reference.shape, bool)
    if mask.shape != reference.shape or mask.dtype != np.bool_:
        raise ValueError(f'mask: expected bool {reference.shape}, got {mask.dtype} {mask.shape}')
    # One layout, so that the kernels are compiled once: messages may be read-only, crops strided.
    return (np.require(reference, requirements=['C', 'W']),
            np.require(test, requirements=['C', 'W']), np.require(mask, requirements=['C', 'W']))

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
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.types import FloatMap

Mask = NDArray[np.bool_]

_PEAK = 255.0
_C1 = (0.01 * _PEAK) ** 2
_C2 = (0.03 * _PEAK) ** 2
_SIGMA = 1.5
_RADIUS = 5  # 3.5 sigma, the 11 x 11 window of Wang et al. 2004
_OFFSET = 128.0  # variances are shift-invariant; centred values keep float32 exact enough


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


def mse(reference: NDArray, test: NDArray, mask: Mask | None = None) -> float:
    """
    Mean squared difference of two maps over the pixels of `mask` (equation 5).

    Returns NaN where the mask holds no pixel.
    """
    _require_same_shape(reference, test, mask)
    difference = reference.astype(np.float32) - test.astype(np.float32)
    if mask is not None:
        difference = difference[mask]
    if difference.size == 0:
        return math.nan
    return float(np.mean(np.square(difference), dtype=np.float64))


def psnr(reference: NDArray, test: NDArray, mask: Mask | None = None) -> float:
    """Peak signal-to-noise ratio in dB over the pixels of `mask` (equation 6), inf at MSE 0."""
    return psnr_from_mse(mse(reference, test, mask))


def psnr_from_mse(error: float) -> float:
    """Turn a mean squared error of 8-bit maps into dB; 0 gives inf, NaN stays NaN."""
    return math.inf if error == 0 else 10.0 * math.log10(_PEAK ** 2 / error)


def ssim(reference: NDArray, test: NDArray, mask: Mask | None = None) -> float:
    """
    Mean structural similarity of two maps over the pixels of `mask` (equations 7-10).

    Outside the mask `test` is set to `reference` first: an unknown pixel says nothing for or
    against its neighbours, whose windows reach it. The outer 5 pixels, where the window leaves
    the image, do not count (as in Wang et al. 2004 and scikit-image), unless nothing else is
    left. Returns NaN where the mask holds no pixel.
    """
    _require_same_shape(reference, test, mask)
    if mask is not None:
        if not mask.any():
            return math.nan
        test = np.where(mask, test, reference)
    similarity = ssim_map(reference, test)
    inner = (slice(_RADIUS, -_RADIUS),) * 2
    if similarity[inner].size and (mask is None or mask[inner].any()):
        similarity, mask = similarity[inner], None if mask is None else mask[inner]
    counted = similarity if mask is None else similarity[mask]
    return float(np.mean(counted, dtype=np.float64))


def ssim_map(reference: NDArray, test: NDArray) -> FloatMap:
    """
    Structural similarity at every pixel, Gaussian window of sigma 1.5, population variances.

    With C3 = C2 / 2 the product l c s of equations 8-10 is
    (2 mu_r mu_t + C1) (2 s_rt + C2) / ((mu_r^2 + mu_t^2 + C1) (s_r^2 + s_t^2 + C2)).
    """
    _require_same_shape(reference, test, None)
    r = reference.astype(np.float32) - np.float32(_OFFSET)
    t = test.astype(np.float32) - np.float32(_OFFSET)
    mean_r, mean_t = _blur(r), _blur(t)
    spread = _blur(r * r + t * t) - mean_r * mean_r - mean_t * mean_t
    covariance = _blur(r * t) - mean_r * mean_t
    mean_r += np.float32(_OFFSET)
    mean_t += np.float32(_OFFSET)
    luminance = (2 * mean_r * mean_t + _C1) / (mean_r * mean_r + mean_t * mean_t + _C1)
    return luminance * (2 * covariance + _C2) / (spread + _C2)


def _blur(values: FloatMap) -> FloatMap:
    size = 2 * _RADIUS + 1
    return cv2.GaussianBlur(
        values, (size, size), _SIGMA, borderType=cv2.BORDER_REFLECT).reshape(values.shape)


def _require_same_shape(reference: NDArray, test: NDArray, mask: Mask | None) -> None:
    if reference.ndim != 2 or reference.shape != test.shape:
        raise ValueError(
            f'expected two maps of one shape (H, W), got {reference.shape} and {test.shape}')
    if mask is not None and (mask.shape != reference.shape or mask.dtype != np.bool_):
        raise ValueError(
            f'mask: expected bool {reference.shape}, got {mask.dtype} {mask.shape}')

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

"""Consistency of a disparity map with that of the other view, and within itself."""

from __future__ import annotations

import cv2
from numba import njit
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.types import FloatMap

# Whole range of the parameters in 16 bits, which is what OpenCV takes.
_LEVELS_PER_PIXEL = 4
_HOLE = np.int16(-1 << 15)


def left_right_check(left: FloatMap, right: FloatMap, tolerance: float) -> NDArray[np.bool_]:
    """
    Find the pixels of the left view whose partner in the right view agrees.

    Parameters
    ----------
    left, right : float32 ndarray of shape (H, W)
        Disparities of both views; column x of `left` meets x - d, column x of `right` x + d.
        NaN is invalid and agrees with nothing.
    tolerance : float
        Largest difference, in pixels.

    Returns
    -------
    bool ndarray of shape (H, W)

    """
    if left.shape != right.shape:
        raise ValueError(f'right: expected shape {left.shape}, got {right.shape}')
    consistent = np.zeros(left.shape, np.bool_)
    _check_kernel(left, right, tolerance, consistent)
    return consistent


def remove_speckles(values: FloatMap, size: int, step: float) -> FloatMap:
    """
    Drop islands: at most `size` pixels, within which neighbours differ by at most `step`.

    Disparities are compared in quarters of a pixel. Returns float32 (H, W), NaN where it dropped
    one or there was none.
    """
    levels = np.where(np.isnan(values), _HOLE, np.rint(values * _LEVELS_PER_PIXEL))
    levels = levels.astype(np.int16)
    cv2.filterSpeckles(levels, int(_HOLE), size, step * _LEVELS_PER_PIXEL)
    return np.where(levels == _HOLE, np.float32(np.nan), values)


@njit(cache=True, nogil=True)
def _check_kernel(left, right, tolerance, consistent):
    height, width = left.shape
    for y in range(height):
        for x in range(width):
            if np.isnan(left[y, x]):
                continue
            partner = int(np.floor(x - left[y, x] + 0.5))
            if 0 <= partner < width:
                # A NaN on the right compares as False.
                consistent[y, x] = abs(left[y, x] - right[y, partner]) <= tolerance

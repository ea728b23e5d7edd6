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

"""Quality without ground truth: the right view, warped by the disparity, against the left."""

from __future__ import annotations

import math

from numba import njit
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.images import to_grey
from stereo_refine_ros.quality.image_metrics import psnr, ssim
from stereo_refine_ros.types import FloatMap, Image, StereoPair


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


def photometric_quality(pair: StereoPair, values: FloatMap) -> tuple[float, float]:
    """
    Measure PSNR (dB) and SSIM of the warped right view against the left, in grey.

    Only valid pixels whose match lies inside the right image count, so a map with many holes
    is judged by its easy pixels: read it beside the valid ratio. Both are NaN without a right
    image or without such a pixel.
    """
    if pair.right is None:
        return math.nan, math.nan
    left, right = to_grey(pair.left), to_grey(pair.right)
    warped, seen = warp_right(right, values)
    return psnr(left, warped, seen), ssim(left, warped, seen)

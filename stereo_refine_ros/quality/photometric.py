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

import cv2
import numpy as np
from numpy.typing import NDArray

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
        0 where nothing was fetched. OpenCV interpolates in steps of 1/32 px.
    seen : bool ndarray of shape (H, W)
        Valid pixels whose match lies inside the right image.

    """
    height, width = values.shape
    column = np.arange(width, dtype=np.float32) - values
    seen = (column >= 0) & (column <= width - 1)
    column[~seen] = -2.0
    row = np.repeat(np.arange(height, dtype=np.float32)[:, None], width, axis=1)
    warped = cv2.remap(right, column, row, cv2.INTER_LINEAR,
                       borderMode=cv2.BORDER_CONSTANT, borderValue=0)
    return warped.reshape(height, width), seen


def photometric_quality(pair: StereoPair, values: FloatMap) -> tuple[float, float]:
    """
    Measure PSNR (dB) and SSIM of the warped right view against the left, in grey.

    Only valid pixels whose match lies inside the right image count, so a map with many holes
    is judged by its easy pixels: read it beside the valid ratio. Both are NaN without a right
    image or without such a pixel.
    """
    if pair.right is None:
        return math.nan, math.nan
    left, right = _grey(pair.left), _grey(pair.right)
    warped, seen = warp_right(right, values)
    return psnr(left, warped, seen), ssim(left, warped, seen)


def _grey(image: Image) -> Image:
    return image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)

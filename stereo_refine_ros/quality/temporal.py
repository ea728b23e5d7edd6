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

"""Flicker of a disparity video: how much it changes where the image does not."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.images import to_grey
from stereo_refine_ros.types import FloatMap, Image

_NEIGHBOURHOOD = np.ones((3, 3), np.uint8)


def unchanged_pixels(previous: Image, current: Image, threshold: int = 3) -> NDArray[np.bool_]:
    """
    Find pixels whose 3x3 neighbourhood changes by at most `threshold` grey levels.

    The neighbourhood keeps out pixels of a moving texture that are alike by chance.

    Parameters
    ----------
    previous, current : uint8 ndarray of shape (H, W) or (H, W, 3) BGR
        Left views of two successive frames.
    threshold : int
        Grey levels of sensor noise that still count as no change.

    """
    difference = cv2.absdiff(to_grey(previous), to_grey(current))
    return cv2.dilate(difference, _NEIGHBOURHOOD) <= threshold


def temporal_noise(previous: FloatMap, current: FloatMap, unchanged: NDArray[np.bool_]) -> float:
    """
    Mean absolute change of disparity in pixels between two frames.

    Parameters
    ----------
    previous, current : float32 ndarray of shape (H, W)
        Pixels, NaN invalid.
    unchanged : bool ndarray of shape (H, W)
        From `unchanged_pixels`; those of them that are valid in both frames count.

    Returns
    -------
    float
        NaN where no pixel counts.

    """
    change = np.abs(current[unchanged] - previous[unchanged])
    change = change[np.isfinite(change)]
    return float(np.mean(change, dtype=np.float64)) if change.size else math.nan

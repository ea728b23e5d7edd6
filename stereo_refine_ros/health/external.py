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

"""What an external map says of itself, beside the own match and the two views."""

from __future__ import annotations

import math

import cv2
import numpy as np

from stereo_refine_ros.health import tuning
from stereo_refine_ros.types import FloatMap, Image


def given_agreement(given: FloatMap, match: FloatMap) -> float:
    """
    Return the share of matched pixels on which an external map agrees with the own match.

    Parameters
    ----------
    given, match : float32 ndarray of shape (H, W)
        Disparities of the left view, pixels, NaN unknown; of `match` only what is sure.

    Returns
    -------
    float
        0..1, NaN where no pixel has both.

    """
    is_known = np.isfinite(given) & np.isfinite(match)
    count = np.count_nonzero(is_known)
    if count == 0:
        return math.nan
    return float(np.count_nonzero(np.abs(given - match)[is_known] <= tuning.AGREE_PX)) / count


def fits_right_better(given: FloatMap, left: Image, right: Image) -> bool:
    """
    Tell whether an external map is one of the right view, not of the left.

    Edges of one view are looked for in the other where the map says that they are.

    Parameters
    ----------
    given : float32 ndarray of shape (H, W)
        Pixels, NaN unknown.
    left, right : uint8 ndarray of shape (H, W)
        Grey.

    """
    rows = slice(None, None, tuning.EVERY_ROW)
    given = given[rows]
    slopes = [_slope(view)[rows] for view in (left, right)]
    of_left = _edge_error(given, slopes[0], slopes[1], -1)
    of_right = _edge_error(given, slopes[1], slopes[0], 1)
    return math.isfinite(of_left) and of_right < tuning.CLEARLY_BETTER * of_left


def _slope(view: Image) -> FloatMap:
    """Return the change along the rows of a smoothed view, grey levels a pixel."""
    smooth = cv2.GaussianBlur(view, (0, 0), tuning.EDGE_BLUR_PX)
    return np.asarray(cv2.Sobel(smooth, cv2.CV_32F, 1, 0, ksize=1, scale=0.5))


def _edge_error(given: FloatMap, own: FloatMap, other: FloatMap, sign: int) -> float:
    """Return the mean difference of edges, over their mean strength, 0 for a perfect map."""
    is_edge = np.isfinite(given) & (np.abs(own) >= tuning.EDGE)
    y, x = np.nonzero(is_edge)
    target = np.rint(x + sign * given[y, x]).astype(np.int64)
    is_inside = (target >= 0) & (target < own.shape[1])
    y, x, target = y[is_inside], x[is_inside], target[is_inside]
    if len(y) == 0:
        return math.inf
    return float(np.abs(own[y, x] - other[y, target]).mean() / np.abs(own[y, x]).mean())

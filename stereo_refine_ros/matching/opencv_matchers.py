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

"""OpenCV's block matchers, with the padding and the left-right check they lack."""

from __future__ import annotations

import cv2
import numpy as np

from stereo_refine_ros.matching.match import Match
from stereo_refine_ros.params import MatchingParams
from stereo_refine_ros.types import DisparityMap, FloatMap, StereoPair

_BLOCK_SIZE = 5


def match_sgbm(pair: StereoPair, params: MatchingParams, threads: int = 1) -> Match:
    """
    Match with OpenCV's three-way semi-global matcher.

    OpenCV searches multiples of 16 disparities and gives nothing in the first columns; both
    images are padded on the left, and what lies outside the asked range is invalid.
    """
    rounded = -(-params.num_disparities // 16) * 16
    reach = max(0, params.min_disparity + rounded)
    matcher = cv2.StereoSGBM_create(
        minDisparity=params.min_disparity, numDisparities=rounded, blockSize=_BLOCK_SIZE,
        P1=8 * _BLOCK_SIZE ** 2, P2=32 * _BLOCK_SIZE ** 2, disp12MaxDiff=1, preFilterCap=63,
        uniquenessRatio=10, speckleWindowSize=100, speckleRange=2,
        mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY)
    left, right = (cv2.copyMakeBorder(image, 0, 0, reach, 0, cv2.BORDER_REPLICATE)
                   for image in (pair.left, pair.right))
    fixed = matcher.compute(left, right)[:, reach:]
    return Match(DisparityMap(
        _to_float(fixed, params), params.min_disparity, params.num_disparities))


def _to_float(fixed: np.ndarray, params: MatchingParams) -> FloatMap:
    values = fixed.astype(np.float32) / 16.0
    low, high = params.min_disparity, params.min_disparity + params.num_disparities
    values[(fixed < low * 16) | (values >= high)] = np.nan
    return values

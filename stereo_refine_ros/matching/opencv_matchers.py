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

"""OpenCV's block matchers, with the padding and the free range that they lack."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from stereo_refine_ros.images import pad
from stereo_refine_ros.matching.match import Match
from stereo_refine_ros.matching.tuning import BM_BLOCK, OPENCV_CHECKS, SGBM_BLOCK, SGBM_PREFILTER
from stereo_refine_ros.params import MatchingParams
from stereo_refine_ros.types import DisparityMap, FloatMap, StereoPair


def match_sgbm(pair: StereoPair, params: MatchingParams, threads: int = 1) -> Match:
    """Match with OpenCV's three-way semi-global matcher; OpenCV keeps its own threads."""
    values_per_block = SGBM_BLOCK ** 2 * pair.left[0, 0].size
    matcher = cv2.StereoSGBM_create(
        minDisparity=params.min_disparity, numDisparities=_rounded(params),
        blockSize=SGBM_BLOCK, P1=8 * values_per_block, P2=32 * values_per_block,
        preFilterCap=SGBM_PREFILTER, mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY, **OPENCV_CHECKS)
    return _match(matcher, pair.left, pair.right, params)


def match_bm(pair: StereoPair, params: MatchingParams, threads: int = 1) -> Match:
    """Match with OpenCV's block matcher on grey images; OpenCV keeps its own threads."""
    matcher = cv2.StereoBM_create(_rounded(params), BM_BLOCK)
    matcher.setMinDisparity(params.min_disparity)
    matcher.setDisp12MaxDiff(OPENCV_CHECKS['disp12MaxDiff'])
    matcher.setUniquenessRatio(OPENCV_CHECKS['uniquenessRatio'])
    matcher.setSpeckleWindowSize(OPENCV_CHECKS['speckleWindowSize'])
    matcher.setSpeckleRange(OPENCV_CHECKS['speckleRange'])
    assert pair.right is not None
    return _match(matcher, pair.left_grey, pair.right_grey, params)


def _rounded(params: MatchingParams) -> int:
    """Round the number of disparities up to a multiple of 16, which OpenCV asks for."""
    return -(-params.num_disparities // 16) * 16


def _match(matcher: Any, left: Any, right: Any, params: MatchingParams) -> Match:
    """
    Run a matcher on padded images and drop what lies outside the asked range.

    OpenCV gives nothing where a pixel's whole range is not in view, nor within half a block of
    the border; so both images grow by as much.
    """
    margin = BM_BLOCK
    before = margin + max(0, params.min_disparity + _rounded(params))
    after = margin + max(0, -params.min_disparity)
    left, right = (pad(image, (margin, margin), (before, after)) for image in (left, right))
    height, width = left.shape[:2]
    fixed = matcher.compute(left, right)[margin:height - margin, before:width - after]
    values = _to_float(fixed, params)
    return Match(DisparityMap(values, params.min_disparity, params.num_disparities))


def _to_float(fixed: np.ndarray, params: MatchingParams) -> FloatMap:
    """Turn sixteenths into pixels; NaN outside the range (OpenCV marks holes below it)."""
    values = fixed.astype(np.float32) / 16.0
    low, high = params.min_disparity, params.min_disparity + params.num_disparities
    values[(values < low) | (values >= high)] = np.nan
    return values

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
OpenCV's own matchers and filters, to compare with.

Needs numpy and OpenCV only. Those of opencv-contrib run in an environment of their own, where
this file is a program: a pair of images in, times and disparities out.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
import json
from typing import Any

import cv2
import numpy as np
from timing import time_rounds

BASE = 'SGBM 3-way'
WLS_CONFIDENCE = 'WLS confidence'
BLOCK = 5
Views = tuple[np.ndarray, np.ndarray]


def sgbm(num_disparities: int, mode: int) -> Any:
    """Return an SGBM matcher with the settings that its documentation suggests."""
    return cv2.StereoSGBM_create(
        minDisparity=0, numDisparities=-(-num_disparities // 16) * 16, blockSize=BLOCK,
        P1=8 * BLOCK ** 2, P2=32 * BLOCK ** 2, disp12MaxDiff=1, preFilterCap=63,
        uniquenessRatio=10, speckleWindowSize=100, speckleRange=2, mode=mode)


def to_pixels(fixed: np.ndarray) -> np.ndarray:
    """Turn OpenCV's sixteenths into float32 pixels, NaN where it found nothing."""
    return np.where(fixed < 0, np.nan, fixed / 16.0).astype(np.float32)


def pad(views: Views, columns: int) -> Views:
    """Add columns on the left, without which the matcher leaves the left border empty."""
    left, right = (cv2.copyMakeBorder(view, 0, 0, columns, 0, cv2.BORDER_REPLICATE)
                   for view in views)
    return left, right


def match(views: Views, num_disparities: int, mode: int) -> np.ndarray:
    """Match as it stands."""
    return to_pixels(sgbm(num_disparities, mode).compute(*views))


def match_padded(views: Views, num_disparities: int) -> np.ndarray:
    """Match the padded views, three-way."""
    mode = cv2.STEREO_SGBM_MODE_SGBM_3WAY
    return match(pad(views, num_disparities), num_disparities, mode)[:, num_disparities:]


def wls(views: Views, num_disparities: int) -> tuple[np.ndarray, np.ndarray]:
    """Match left and right, and smooth by weighted least squares; return its confidence too."""
    left, right = pad(views, num_disparities)
    matcher = sgbm(num_disparities, cv2.STEREO_SGBM_MODE_SGBM_3WAY)
    smoother = cv2.ximgproc.createDisparityWLSFilter(matcher)
    smoother.setLambda(8000.0)
    smoother.setSigmaColor(1.5)
    right_matcher = cv2.ximgproc.createRightMatcher(matcher)
    filtered = smoother.filter(
        matcher.compute(left, right), left, None, right_matcher.compute(right, left))
    confidence = smoother.getConfidenceMap().astype(np.float32) / 255.0
    return to_pixels(filtered)[:, num_disparities:], confidence[:, num_disparities:]


def match_wls(views: Views, num_disparities: int) -> np.ndarray:
    """Match left and right, and smooth by weighted least squares."""
    return wls(views, num_disparities)[0]


def fill_rows(values: np.ndarray) -> np.ndarray:
    """Fill each hole with the value to its left, at the border with the one to its right."""
    for flipped in (values, values[:, ::-1]):
        column = np.where(np.isnan(flipped), 0, np.arange(values.shape[1]))
        last = np.maximum.accumulate(column, axis=1)
        flipped[...] = np.take_along_axis(flipped, last, axis=1)
    return np.nan_to_num(values)


def match_weighted_median(views: Views, num_disparities: int) -> np.ndarray:
    """Match and filter by OpenCV's weighted median."""
    filled = fill_rows(match_padded(views, num_disparities))
    return cv2.ximgproc.weightedMedianFilter(views[0], filled, 7)


def segment(views: Views) -> np.ndarray:
    """Segment the left image by OpenCV's graph segmentation."""
    segmentation = cv2.ximgproc.segmentation.createGraphSegmentation(0.5, 300.0, 50)
    return segmentation.processImage(views[0])


def plain_methods(views: Views, num_disparities: int) -> dict[str, Callable[[], np.ndarray]]:
    """Return what OpenCV's main package has."""
    return {
        BASE: lambda: match(views, num_disparities, cv2.STEREO_SGBM_MODE_SGBM_3WAY),
        'SGBM': lambda: match(views, num_disparities, cv2.STEREO_SGBM_MODE_SGBM),
        'SGBM 3-way, padded': lambda: match_padded(views, num_disparities)}


def contrib_methods(views: Views, num_disparities: int) -> dict[str, Callable[[], np.ndarray]]:
    """Return what opencv-contrib adds, and the base of the ratios."""
    return {
        BASE: lambda: match(views, num_disparities, cv2.STEREO_SGBM_MODE_SGBM_3WAY),
        'SGBM 3-way + WLS': lambda: match_wls(views, num_disparities),
        'SGBM 3-way + weighted median': lambda: match_weighted_median(views, num_disparities),
        'graph segmentation': lambda: segment(views)}


def main() -> None:
    """Read a pair, write the disparities, print the times as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('pair', help='npz file with left, right and num_disparities')
    parser.add_argument('output', help='npz file for the disparities, by method')
    parser.add_argument('--rounds', type=int, default=15)
    parser.add_argument('--budget', type=float, default=10.0, help='seconds per method')
    options = parser.parse_args()
    pair = np.load(options.pair)
    views, num_disparities = (pair['left'], pair['right']), int(pair['num_disparities'])
    times, results = time_rounds(
        contrib_methods(views, num_disparities), options.rounds, options.budget)
    results[WLS_CONFIDENCE] = wls(views, num_disparities)[1]
    np.savez(options.output, **results)
    print(json.dumps({'version': cv2.__version__, 'times': times}))


if __name__ == '__main__':
    main()

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

"""The figures of one frame under the keys of the metrics topic."""

from dataclasses import replace
import math

import numpy as np
import pytest

from stereo_refine_ros.quality.frame import (
    confidence_figures, mean_inlier_ratio, measure_frame, TRUTH_KEYS)
from stereo_refine_ros.quality.photometric import compare_photometric
from stereo_refine_ros.quality.summary import measure_against_truth
from stereo_refine_ros.types import (
    DisparityMap, PairHealth, PlaneSegmentation, RefinementResult, StereoPair)


def frame():
    """Make a result of three segments, one of them without a plane."""
    rng = np.random.default_rng(1)
    image = rng.integers(0, 256, (20, 32), dtype=np.uint8)
    truth = np.full((20, 32), 6, np.float32)
    preliminary = truth.copy()
    preliminary[:5] = np.nan
    preliminary[5:8] = 9
    labels = np.zeros((20, 32), np.int32)
    labels[:, 8:] = 1
    labels[:, 24:] = 2
    segments = PlaneSegmentation(
        labels, np.array([[0, 0, 6.0], [0, 0, 6], [np.nan] * 3]),
        np.array([True, True, False]), np.array([1, 0.5, np.nan], np.float32))
    result = RefinementResult(
        DisparityMap(truth + np.float32(0.25), 0, 60), DisparityMap(preliminary, 0, 60),
        segments, 0.75, {'matching': 3.0, 'planes': 1.5}, 4.5)
    return result, StereoPair(image, np.roll(image, -6, axis=1)), truth


def test_figures_of_confidence_and_health():
    result, _, _ = frame()
    result = replace(
        result, confidence=np.array([[0.0, 0.5, 0.75, 1.0]], np.float32),
        health=PairHealth(row_offset_px=0.5, gain_ratio=1.125, noise_sigma=2.0))
    assert confidence_figures(result, 0.5) == {
        'confidence_mean': 0.5625, 'published_ratio': 0.75, 'row_offset_px': 0.5,
        'gain_ratio': 1.125, 'noise_sigma': 2.0}


def test_keys_and_values_without_truth():
    result, pair, _ = frame()
    figures = measure_frame(result, pair)
    assert figures['matching_ms'] == 3
    assert figures['total_ms'] == 4.5
    assert (figures['segments'], figures['planes_fitted']) == (3, 2)
    assert figures['inlier_ratio'] == pytest.approx((8 + 16 * 0.5) / 24)
    assert figures['valid_ratio_preliminary'] == 0.75
    assert figures['valid_ratio_refined'] == 1
    assert figures['lr_consistent_ratio'] == 0.75
    compared = compare_photometric(pair, result.preliminary.values, result.disparity.values)
    for name, quality in zip(('preliminary', 'refined'), compared, strict=True):
        assert (figures[f'photometric_psnr_{name}'], figures[f'photometric_ssim_{name}']) == (
            quality.psnr, quality.ssim)
    assert not any(key.startswith(TRUTH_KEYS) for key in figures)


def test_truth_adds_its_keys_for_both_maps():
    result, pair, truth = frame()
    figures = measure_frame(result, pair, truth)
    for name, disparity in (('preliminary', result.preliminary), ('refined', result.disparity)):
        expected = measure_against_truth(disparity.values, truth, 4)
        for key in TRUTH_KEYS:
            assert figures[f'{key}_{name}'] == expected[key]
    assert figures['mse_refined'] == 1
    assert measure_frame(result, pair, truth, scale=8)['mse_refined'] == 4


def test_no_fitted_plane_has_no_inlier_ratio():
    segments = PlaneSegmentation(np.zeros((2, 2), np.int32), np.full((1, 3), np.nan),
                                 np.zeros(1, bool), np.full(1, np.nan, np.float32))
    assert math.isnan(mean_inlier_ratio(segments))

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

"""All figures of one frame, under the keys of the `metrics` topic."""

from __future__ import annotations

import math

import numpy as np

from stereo_refine_ros.quality.image_metrics import default_scale
from stereo_refine_ros.quality.photometric import compare_photometric
from stereo_refine_ros.quality.summary import measure_against_truth
from stereo_refine_ros.types import FloatMap, PlaneSegmentation, RefinementResult, StereoPair

# The photometric figures look at every n-th row, so that at most this many are looked at.
PHOTOMETRIC_ROWS = 60
TRUTH_KEYS = ('mse', 'psnr', 'ssim', 'bad_1_0', 'bad_2_0', 'avg_error')


def measure_frame(result: RefinementResult, pair: StereoPair, truth: FloatMap | None = None,
                  scale: float | None = None) -> dict[str, float]:
    """
    Measure one refined frame; the live node and the offline evaluation both use this.

    Parameters
    ----------
    result : RefinementResult
        What the pipeline returned.
    pair : StereoPair
        What `result` was computed from; without a right image the photometric keys are NaN.
    truth : float32 ndarray of shape (H, W), optional
        Pixels, NaN unknown; adds the keys of `TRUTH_KEYS`, for both maps.
    scale : float, optional
        Grey levels per pixel of the 8-bit maps; `default_scale` of the search range if None.

    Returns
    -------
    dict of str to float
        In the order and with the units of the `metrics` topic.

    """
    segments = result.segments
    figures = {f'{stage}_ms': time for stage, time in result.stage_ms.items()}
    figures['total_ms'] = result.total_ms
    figures['segments'] = float(len(segments.planes))
    figures['planes_fitted'] = float(np.count_nonzero(segments.is_fitted))
    figures['inlier_ratio'] = mean_inlier_ratio(segments)
    maps = {'preliminary': result.preliminary, 'refined': result.disparity}
    for name, disparity in maps.items():
        figures[f'valid_ratio_{name}'] = disparity.valid_ratio
    figures['lr_consistent_ratio'] = result.lr_consistent_ratio
    step = -(-pair.shape[0] // PHOTOMETRIC_ROWS)
    right = None if pair.right is None else np.ascontiguousarray(pair.right[::step])
    rows = StereoPair(np.ascontiguousarray(pair.left[::step]), right)
    compared = compare_photometric(
        rows, *(disparity.values[::step] for disparity in maps.values()))
    for name, quality in zip(maps, compared, strict=True):
        figures[f'photometric_psnr_{name}'] = quality.psnr
        figures[f'photometric_ssim_{name}'] = quality.ssim
    if truth is not None:
        scale = default_scale(result.disparity.num_disparities) if scale is None else scale
        for name, disparity in maps.items():
            against = measure_against_truth(disparity.values, truth, scale)
            figures.update({f'{key}_{name}': against[key] for key in TRUTH_KEYS})
    return figures


def confidence_figures(result: RefinementResult, min_confidence: float) -> dict[str, float]:
    """
    Sum up confidence and health of a frame.

    Parameters
    ----------
    result : RefinementResult
        What the pipeline returned.
    min_confidence : float
        From where on a disparity counts as published.

    Returns
    -------
    dict of str to float
        Under the keys of the `metrics` topic.

    """
    health = result.health
    return {
        'confidence_mean': float(np.mean(result.confidence)),
        'published_ratio': float(np.mean(result.confidence >= min_confidence)),
        'row_offset_px': health.row_offset_px, 'gain_ratio': health.gain_ratio,
        'noise_sigma': health.noise_sigma}


def mean_inlier_ratio(segments: PlaneSegmentation) -> float:
    """Average the inlier ratio of the fitted segments, weighted by their pixels; NaN if none."""
    pixels = np.bincount(segments.labels.reshape(-1), minlength=len(segments.planes))
    weights = np.where(segments.is_fitted, pixels, 0)
    total = weights.sum()
    if total == 0:
        return math.nan
    return float(np.sum(weights * np.where(segments.is_fitted, segments.inlier_ratio, 0)) / total)

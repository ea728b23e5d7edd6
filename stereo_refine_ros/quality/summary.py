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

"""One frame's figures by name: the same for the live node and for the offline evaluation."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np

from stereo_refine_ros.quality.disparity_errors import measure_errors
from stereo_refine_ros.quality.image_metrics import mse, psnr_from_mse, ssim, to_8bit
from stereo_refine_ros.refinement.filling import fill_from_background
from stereo_refine_ros.types import FloatMap


def measure_against_truth(values: FloatMap, truth: FloatMap, scale: float) -> dict[str, float]:
    """
    Measure a disparity map against the truth, its holes filled from the background first.

    Without the filling a map with holes would lose to any dense one, and a refinement would
    earn praise for filling alone.

    Parameters
    ----------
    values, truth : float32 ndarray of shape (H, W)
        Pixels, NaN invalid and unknown.
    scale : float
        Grey levels per pixel of the 8-bit maps (see `image_metrics.to_8bit`).

    Returns
    -------
    dict of str to float
        'mse', 'psnr', 'ssim' of the 8-bit maps over known pixels; 'mse_all_pixels' and
        'psnr_all_pixels' with unknown truth as 0; 'bad_0_5', 'bad_1_0', 'bad_2_0', 'bad_3_0'
        in percent and 'avg_error' in pixels over known pixels; 'density', share of all pixels
        that were valid before the filling.

    """
    known = np.isfinite(truth)
    filled = fill_from_background(values)
    reference, test = to_8bit(truth, scale), to_8bit(filled, scale)
    error, error_all = mse(reference, test, known), mse(reference, test)
    figures = {
        'mse': error, 'psnr': psnr_from_mse(error), 'ssim': ssim(reference, test, known),
        'mse_all_pixels': error_all, 'psnr_all_pixels': psnr_from_mse(error_all)}
    figures.update(asdict(measure_errors(filled, truth)))
    figures['density'] = float(np.count_nonzero(np.isfinite(values))) / values.size
    return figures

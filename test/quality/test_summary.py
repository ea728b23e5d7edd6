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

"""The figures of one frame: which pixels count, and that filling earns nothing."""

import numpy as np
import pytest

from stereo_refine_ros.quality.summary import measure_against_truth


def test_figures_by_hand():
    truth = np.full((20, 20), 10, np.float32)
    truth[:, 0] = np.nan
    values = np.full((20, 20), 10, np.float32)
    values[0, 1], values[1, 1] = 12, np.nan
    figures = measure_against_truth(values, truth, 4)
    assert figures['mse'] == pytest.approx(64 / 380)
    assert figures['mse_all_pixels'] == pytest.approx((64 + 20 * 1600) / 400)
    assert figures['psnr'] > figures['psnr_all_pixels']
    assert figures['bad_1_0'] == pytest.approx(100 / 380)
    assert figures['bad_2_0'] == 0
    assert figures['avg_error'] == pytest.approx(2 / 380)
    assert figures['density'] == pytest.approx(399 / 400)


def test_perfect_map():
    truth = np.random.default_rng(0).uniform(1, 60, (20, 24)).astype(np.float32)
    figures = measure_against_truth(truth, truth, 4)
    assert (figures['mse'], figures['psnr']) == (0, np.inf)
    assert figures['ssim'] == pytest.approx(1, abs=1e-6)
    assert (figures['bad_0_5'], figures['avg_error'], figures['density']) == (0, 0, 1)

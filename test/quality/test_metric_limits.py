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

"""Metrics at the edges of their definition: no error at all, no pixel at all, scale limits."""

import math
import warnings

import numpy as np
import pytest

from stereo_refine_ros.quality.disparity_errors import measure_errors
from stereo_refine_ros.quality.image_metrics import (
    default_scale, mse, psnr_from_mse, ssim_map, to_8bit)

FLAT = np.full((12, 12), 7, np.uint8)


def test_decibels_of_no_error_and_of_one_grey_level():
    assert psnr_from_mse(0.0) == math.inf
    assert psnr_from_mse(1.0) == pytest.approx(20 * math.log10(255))


@pytest.mark.parametrize('span,scale', [
    (1, 255.0), (2, 127.0), (254, 1.0), (255, 1.0), (256, 255 / 256), (510, 0.5)])
def test_scales_that_just_fit_8_bits(span, scale):
    assert default_scale(span) == scale


def test_no_disparity_has_no_scale():
    with pytest.raises(ValueError, match='at least 1, got 0'):
        default_scale(0)


def test_no_pixel_is_nan_without_a_warning():
    nothing = np.zeros(FLAT.shape, bool)
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        assert math.isnan(mse(FLAT, FLAT, nothing))
        unknown = np.full((2, 2), np.nan, np.float32)
        assert math.isnan(measure_errors(unknown, unknown).avg_error)


def test_types_of_maps():
    assert to_8bit(np.float32([[1.2, np.nan]]), 2.0).dtype == np.uint8
    assert ssim_map(FLAT, FLAT).dtype == np.float32


def test_a_mask_of_another_shape_is_named():
    values = np.ones((2, 2), np.float32)
    with pytest.raises(ValueError, match=r'mask \(2, 3\)'):
        measure_errors(values, values, np.ones((2, 3), bool))
    with pytest.raises(ValueError) as refused:
        measure_errors(values, np.ones((2, 3), np.float32))
    assert 'mask' not in str(refused.value) and 'XX' not in str(refused.value)

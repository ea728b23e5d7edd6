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

"""MSE, PSNR and SSIM against hand-computed values, the paper's equations and scikit-image."""

import math

import numpy as np
import pytest
from skimage.metrics import structural_similarity

from stereo_refine_ros.quality.image_metrics import (
    default_scale,
    mse,
    psnr,
    psnr_from_mse,
    ssim,
    ssim_map,
    to_8bit,
)


def random_pair(shape=(40, 52), noise=30):
    """Two 8-bit maps, the second a noisy copy of the first."""
    rng = np.random.default_rng(3)
    reference = rng.integers(0, 256, shape)
    test = np.clip(reference + rng.integers(-noise, noise + 1, shape), 0, 255)
    return reference.astype(np.uint8), test.astype(np.uint8)


def naive_ssim_map(reference, test):
    """Equations 7-10 as they stand: l, c and s apart, one window after another, in float64."""
    radius, peak = 5, 255.0
    c1, c2 = (0.01 * peak) ** 2, (0.03 * peak) ** 2
    c3 = c2 / 2
    axis = np.arange(-radius, radius + 1)
    window = np.exp(-(axis[:, None] ** 2 + axis[None, :] ** 2) / (2 * 1.5 ** 2))
    window /= window.sum()
    r, t = (np.pad(image.astype(float), radius, 'symmetric') for image in (reference, test))
    out = np.empty(reference.shape)
    for y, x in np.ndindex(reference.shape):
        patch_r = r[y:y + 2 * radius + 1, x:x + 2 * radius + 1]
        patch_t = t[y:y + 2 * radius + 1, x:x + 2 * radius + 1]
        mu_r, mu_t = (window * patch_r).sum(), (window * patch_t).sum()
        s_r = math.sqrt((window * (patch_r - mu_r) ** 2).sum())
        s_t = math.sqrt((window * (patch_t - mu_t) ** 2).sum())
        s_rt = (window * (patch_r - mu_r) * (patch_t - mu_t)).sum()
        luminance = (2 * mu_r * mu_t + c1) / (mu_r ** 2 + mu_t ** 2 + c1)
        contrast = (2 * s_r * s_t + c2) / (s_r ** 2 + s_t ** 2 + c2)
        out[y, x] = luminance * contrast * (s_rt + c3) / (s_r * s_t + c3)
    return out


def test_mse_and_psnr_by_hand():
    reference = np.array([[10, 20], [30, 40]], np.uint8)
    test = np.array([[13, 20], [30, 36]], np.uint8)
    assert mse(reference, test) == 6.25
    assert psnr(reference, test) == pytest.approx(10 * math.log10(65025 / 6.25))
    assert psnr(reference, test) == pytest.approx(40.1720, abs=1e-4)


def test_unsigned_difference_does_not_wrap():
    low, high = np.zeros((2, 2), np.uint8), np.full((2, 2), 255, np.uint8)
    assert mse(low, high) == mse(high, low) == 65025
    assert psnr(low, high) == 0


def test_mse_matches_numpy():
    reference, test = random_pair()
    mask = np.random.default_rng(4).random(reference.shape) < 0.3
    expected = np.mean((reference[mask].astype(float) - test[mask]) ** 2)
    assert mse(reference, test, mask) == pytest.approx(expected, rel=1e-12)


def test_psnr_is_infinite_for_equal_maps():
    image = random_pair()[0]
    assert mse(image, image) == 0
    assert psnr(image, image) == math.inf
    assert psnr_from_mse(65025.0) == 0


def test_mask_chooses_the_pixels():
    reference = np.array([[10, 20], [30, 40]], np.uint8)
    test = np.array([[13, 20], [30, 140]], np.uint8)
    mask = np.array([[True, True], [True, False]])
    assert mse(reference, test, mask) == 3
    assert math.isnan(mse(reference, test, np.zeros((2, 2), bool)))
    assert math.isnan(psnr(reference, test, np.zeros((2, 2), bool)))
    assert math.isnan(ssim(reference, test, np.zeros((2, 2), bool)))


def test_ssim_of_flat_maps_is_the_luminance_term():
    reference, test = np.full((20, 20), 100, np.uint8), np.full((20, 20), 150, np.uint8)
    expected = (2 * 100 * 150 + 6.5025) / (100 ** 2 + 150 ** 2 + 6.5025)
    assert ssim(reference, test) == pytest.approx(expected, abs=1e-5)


def test_ssim_of_equal_maps_is_one():
    image = random_pair()[0]
    assert ssim(image, image) == pytest.approx(1, abs=1e-6)


def test_ssim_map_follows_the_equations():
    reference, test = random_pair((14, 17))
    np.testing.assert_allclose(
        ssim_map(reference, test), naive_ssim_map(reference, test), atol=2e-5)


@pytest.mark.parametrize('noise', [2, 30, 200])
def test_ssim_equals_scikit_image(noise):
    reference, test = random_pair(noise=noise)
    expected, full = structural_similarity(
        reference, test, gaussian_weights=True, sigma=1.5, use_sample_covariance=False,
        data_range=255, full=True)
    np.testing.assert_allclose(ssim_map(reference, test), full, atol=2e-5)
    assert ssim(reference, test) == pytest.approx(expected, abs=1e-5)


def test_ssim_of_many_bands_of_read_only_and_strided_maps():
    reference, test = random_pair((150, 90))
    expected = structural_similarity(
        reference[:, ::2], test[:, ::2], gaussian_weights=True, sigma=1.5,
        use_sample_covariance=False, data_range=255)
    reference.flags.writeable = False
    assert ssim(reference[:, ::2], test[:, ::2]) == pytest.approx(expected, abs=1e-5)


def test_masked_ssim_ignores_what_lies_outside():
    reference, test = random_pair()
    mask = np.ones(reference.shape, bool)
    mask[10:20, 10:25] = False
    other = np.where(mask, test, 255).astype(np.uint8)
    assert ssim(reference, test, mask) == ssim(reference, other, mask)
    similarity = ssim_map(reference, test, mask)
    np.testing.assert_array_equal(
        similarity, ssim_map(reference, np.where(mask, test, reference)))
    inside = similarity[5:-5, 5:-5][mask[5:-5, 5:-5]]
    assert ssim(reference, test, mask) == pytest.approx(inside.mean(), abs=1e-6)


def test_ssim_of_a_map_smaller_than_the_border_takes_every_pixel():
    reference, test = random_pair((7, 9))
    assert ssim(reference, test) == pytest.approx(ssim_map(reference, test).mean(), abs=1e-6)


def test_to_8bit_rounds_cuts_and_blackens_holes():
    values = np.array([[np.nan, -3, 1.12, 1.13, 63.74, 80]], np.float32)
    np.testing.assert_array_equal(to_8bit(values, 4), [[0, 0, 4, 5, 255, 255]])


@pytest.mark.parametrize(('disparities', 'scale'), [(60, 4), (73, 3), (16, 15), (255, 1)])
def test_default_scale_is_whole_up_to_255(disparities, scale):
    assert default_scale(disparities) == scale


def test_default_scale_of_wide_ranges_still_fits():
    assert default_scale(510) == 0.5
    with pytest.raises(ValueError, match='num_disparities'):
        default_scale(0)


def test_shapes_must_agree():
    with pytest.raises(ValueError, match='test: expected uint8'):
        mse(np.zeros((2, 3), np.uint8), np.zeros((3, 2), np.uint8))
    with pytest.raises(ValueError, match='reference: expected uint8'):
        psnr(np.zeros((2, 3), np.float32), np.zeros((2, 3), np.uint8))
    with pytest.raises(ValueError, match='mask'):
        ssim(np.zeros((2, 3), np.uint8), np.zeros((2, 3), np.uint8), np.zeros((3, 2), bool))

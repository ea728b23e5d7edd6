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

"""Rows of real scenes against figures computed from the raw files, without the package."""

import cv2
import numpy as np
import pytest
from real_scenes import real_scene_folder
from skimage.metrics import structural_similarity

from stereo_refine_ros.datasets import load_scene
from stereo_refine_ros.evaluation.runner import evaluate_scene, measure_stage, Plan
from stereo_refine_ros.refinement.filling import fill_from_background

SCALE = {'tsukuba': 16, 'venus': 8, 'cones': 4}


@pytest.fixture(params=SCALE)
def folder(request):
    return real_scene_folder(request.param)


def raw(path):
    """Read a map as integers, whatever number of channels it is stored with."""
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    return (image if image.ndim == 2 else image[..., 0]).astype(np.int64)


def test_figures_are_those_of_the_raw_files(folder):
    outcome = next(evaluate_scene(load_scene(folder.name, folder.parent),
                                  Plan(matchings=['sgbm'], filters=['none'], repeat=1)))
    row, scale = outcome.rows[0], SCALE[folder.name]
    disparity = fill_from_background(outcome.before.preliminary.values).astype(np.float64)
    truth = raw(folder / 'disp_left.png')
    known = truth > 0 if folder.name != 'venus' else np.ones(truth.shape, bool)
    levels = np.clip(np.rint(disparity * scale), 0, 255)
    assert row['mse'] == pytest.approx(np.mean((levels - truth)[known] ** 2), rel=1e-6)
    assert row['mse_all_pixels'] == pytest.approx(np.mean((levels - truth) ** 2), rel=1e-6)
    assert row['psnr'] == pytest.approx(10 * np.log10(255 ** 2 / row['mse']))
    for region in ('nonocc', 'all', 'disc'):
        counted = known & (raw(folder / f'mask_{region}.png') == 255)
        wrong = np.abs(disparity - truth / scale)[counted] > 1
        assert row[region] == pytest.approx(100 * wrong.mean(), abs=1e-9)


def test_ssim_is_scikit_images_where_both_show_the_truth_of_unknown_pixels(folder):
    scene = load_scene(folder.name, folder.parent)
    disparity = fill_from_background(scene.truth) + np.float32(0.6)
    truth = raw(folder / 'disp_left.png').astype(np.uint8)
    known = np.isfinite(scene.truth)
    levels = np.clip(np.rint(disparity * SCALE[folder.name]), 0, 255).astype(np.uint8)
    _, full = structural_similarity(
        truth, np.where(known, levels, truth), gaussian_weights=True, sigma=1.5,
        use_sample_covariance=False, data_range=255, full=True)
    expected = full[5:-5, 5:-5][known[5:-5, 5:-5]].mean()
    assert measure_stage(disparity, scene)['ssim'] == pytest.approx(expected, abs=1e-5)


def test_the_truth_itself_is_perfect(folder):
    scene = load_scene(folder.name, folder.parent)
    figures = measure_stage(scene.truth, scene)
    assert (figures['mse'], figures['bad_0_5'], figures['avg_error']) == (0, 0, 0)
    assert (figures['nonocc'], figures['all'], figures['disc']) == (0, 0, 0)
    assert figures['ssim'] == pytest.approx(1, abs=1e-6)
    assert figures['density'] == pytest.approx(np.isfinite(scene.truth).mean())

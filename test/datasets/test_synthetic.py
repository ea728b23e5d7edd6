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

"""The rendered scene's truth is exact, and its two views show the same surfaces."""

import cv2
import numpy as np
import pytest

from stereo_refine_ros.datasets import render_scene
from stereo_refine_ros.datasets.scene import visible_in_both
from stereo_refine_ros.params import load_preset
from stereo_refine_ros.pipeline import StereoRefiner
from stereo_refine_ros.rectification import find_row_offset


@pytest.fixture(scope='module', params=[0, 1, 2])
def scene(request):
    return render_scene(request.param)


def _grid(shape):
    return np.meshgrid(np.arange(shape[1], dtype=np.float64), np.arange(shape[0]))


def test_truth_is_the_plane_of_its_label(scene):
    x, y = _grid(scene.truth.shape)
    a, b, c = np.moveaxis(scene.planes[scene.labels], -1, 0)
    np.testing.assert_array_equal(scene.truth, (a * x + b * y + c).astype(np.float32))


def test_disparities_stay_within_the_search_range(scene):
    assert scene.truth.min() > 0
    assert scene.truth.max() < scene.num_disparities - 1


def test_every_surface_is_seen(scene):
    assert set(np.unique(scene.labels)) == set(range(len(scene.planes)))
    assert len(scene.planes) == 8


def test_planes_are_slanted(scene):
    assert (np.abs(scene.planes[:, :2]).max(axis=1) > 0.005).all()


def test_right_truth_leads_back_to_the_same_surface(scene):
    x, y = _grid(scene.truth.shape)
    x_left = x + scene.truth_right
    a, b, c = np.moveaxis(scene.planes[scene.labels_right], -1, 0)
    np.testing.assert_allclose(a * x_left + b * y + c, scene.truth_right, atol=1e-4)


def test_visible_pixels_are_those_that_both_maps_confirm(scene):
    confirmed = visible_in_both(scene.truth, scene.truth_right)
    # The check from the maps rounds to whole columns, so it may differ along outlines.
    assert (confirmed == scene.masks['nonocc']).mean() > 0.99


def test_occluded_pixels_are_behind_something(scene):
    x, y = _grid(scene.truth.shape)
    column = x - scene.truth
    hidden = ~scene.masks['nonocc'] & (column >= 1) & (column < scene.truth.shape[1] - 2)
    assert hidden.any()
    around = [np.floor(column[hidden]).astype(int) + offset for offset in (0, 1)]
    rows = y[hidden].astype(int)
    nearest = np.maximum(scene.truth_right[rows, around[0]], scene.truth_right[rows, around[1]])
    assert (nearest > scene.truth[hidden] - 0.5).mean() > 0.995


def test_warping_the_right_view_gives_the_left(scene):
    x, y = (axis.astype(np.float32) for axis in _grid(scene.truth.shape))
    warped = cv2.remap(scene.pair.right, x - scene.truth, y, cv2.INTER_CUBIC)
    error = np.abs(warped.astype(int) - scene.pair.left).mean(axis=2)
    seen = scene.masks['nonocc']
    assert error[seen].mean() < 0.7
    assert error[~seen].mean() > 20


def test_a_matcher_finds_the_truth(scene):
    params = load_preset('live', {'matching.num_disparities': scene.num_disparities,
                                  'matching.method': 'sgbm'})
    result = StereoRefiner(params).process(scene.pair.left, scene.pair.right)
    seen = scene.masks['nonocc']
    for disparity in (result.preliminary, result.disparity):
        assert (np.abs(disparity.values - scene.truth)[seen] <= 1.0).mean() > 0.85


def test_same_seed_same_pixels_other_seed_others():
    first, again, other = render_scene(7), render_scene(7), render_scene(8)
    np.testing.assert_array_equal(first.pair.left, again.pair.left)
    np.testing.assert_array_equal(first.pair.right, again.pair.right)
    np.testing.assert_array_equal(first.planes, again.planes)
    assert (first.pair.left != other.pair.left).mean() > 0.5


def test_noise_has_the_deviation_asked_for():
    clean, noisy = render_scene(3, noise=0.0), render_scene(3, noise=4.0)
    difference = noisy.pair.left.astype(float) - clean.pair.left
    middle = (clean.pair.left > 20) & (clean.pair.left < 235)
    assert difference[middle].std() == pytest.approx(4.0, rel=0.05)


def test_size_range_and_offset_are_as_asked():
    scene = render_scene(1, height=100, width=140, num_disparities=20, num_patches=2,
                         doffs_px=5.5)
    assert scene.pair.shape == (100, 140)
    assert scene.num_disparities == 20
    assert 0 < scene.truth.min() and scene.truth.max() < 19
    assert scene.planes.shape == (4, 3)
    assert scene.geometry.doffs_px == 5.5
    assert (scene.geometry.focal_px, scene.geometry.baseline_m) == (126.0, 0.12)


@pytest.mark.parametrize('row_offset', [1.5, -2.25])
def test_right_view_is_lower_by_the_row_offset(row_offset):
    level, moved = render_scene(0), render_scene(0, row_offset=row_offset)
    np.testing.assert_array_equal(moved.pair.left, level.pair.left)
    np.testing.assert_array_equal(moved.truth, level.truth)
    x, y = (axis.astype(np.float32) for axis in _grid(moved.truth.shape))
    raised = cv2.remap(moved.pair.right, x, y + np.float32(row_offset), cv2.INTER_CUBIC)
    error = np.abs(raised[4:-4].astype(int) - level.pair.right[4:-4]).mean(axis=2)
    assert np.median(error) < 1.0
    found = find_row_offset(moved.pair.left, moved.pair.right, 0, moved.num_disparities)
    assert found.offset_px == pytest.approx(row_offset, abs=0.1)


@pytest.mark.parametrize('options', [{'height': 20}, {'width': 31}, {'num_disparities': 8}])
def test_too_small_is_refused(options):
    with pytest.raises(ValueError, match='render_scene'):
        render_scene(0, **options)

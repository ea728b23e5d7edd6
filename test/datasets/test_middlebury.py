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

"""Middlebury scenes are decoded to pixels of disparity, whatever form their maps have."""

import cv2
import numpy as np
import pytest

from stereo_refine_ros.datasets import list_scenes, load_scene
from stereo_refine_ros.datasets.middlebury import read_pfm

SCENES = {  # shape, scale, disparities searched, density of the truth, regions
    'tsukuba': ((288, 384), 16, 16, 0.79297, {'all', 'disc', 'nonocc'}),
    'venus': ((383, 434), 8, 20, 1.0, {'all', 'disc', 'nonocc'}),
    'teddy': ((375, 450), 4, 60, 0.97982, {'all', 'disc', 'nonocc'}),
    'cones': ((375, 450), 4, 60, 0.96783, {'all', 'disc', 'nonocc'}),
    'sawtooth': ((380, 434), 8, 19, 1.0, {'all', 'nonocc'}),
    'Art': ((370, 463), 3, 76, 0.99881, {'all', 'nonocc'}),
    'Dolls': ((370, 463), 3, 75, 0.99597, {'all', 'nonocc'}),
    'Adirondack': ((496, 718), 1, 73, 0.99660, {'all', 'nonocc'}),
}


@pytest.mark.parametrize('name', SCENES)
def test_scene_is_what_its_description_says(name):
    shape, scale, num_disparities, density, regions = SCENES[name]
    scene = load_scene(name)
    assert (scene.name, scene.pair.shape) == (name, shape)
    assert (scene.scale, scene.num_disparities) == (scale, num_disparities)
    assert scene.truth.dtype == np.float32
    known = np.isfinite(scene.truth)
    assert known.mean() == pytest.approx(density, abs=1e-5)
    assert scene.truth[known].min() > 0
    assert scene.truth[known].max() < num_disparities
    assert set(scene.masks) == regions
    for mask in scene.masks.values():
        assert mask.dtype == bool and mask.shape == shape
        assert not (mask & ~known).any()


@pytest.mark.parametrize('name', SCENES)
def test_truth_maps_the_right_view_onto_the_left(name):
    scene = load_scene(name)
    height, width = scene.pair.shape
    x, y = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    seen = scene.masks['nonocc']

    def error(disparity):
        warped = cv2.remap(scene.pair.right, x - disparity, y, cv2.INTER_LINEAR)
        return np.abs(warped.astype(int) - scene.pair.left)[seen].mean()

    truth = np.nan_to_num(scene.truth)
    assert error(truth) < 0.5 * error(np.full_like(truth, np.nanmedian(scene.truth)))
    assert error(truth) < 0.75 * error(truth[::-1])


def test_masks_of_one_and_of_three_channels():
    scene = load_scene('cones')
    assert scene.masks['nonocc'].mean() == pytest.approx(0.85289, abs=1e-5)
    assert scene.masks['all'].mean() == pytest.approx(0.96783, abs=1e-5)
    assert scene.masks['disc'].mean() == pytest.approx(0.27964, abs=1e-5)


def test_derived_mask_stands_in_for_the_missing_one():
    assert load_scene('Art').masks['nonocc'].mean() == pytest.approx(0.76129, abs=1e-5)


def test_geometry_with_offset_principal_points():
    geometry = load_scene('Adirondack').geometry
    assert geometry.focal_px == 1038.018
    assert geometry.baseline_m == pytest.approx(0.176252)
    assert geometry.doffs_px == pytest.approx(53.271)
    assert load_scene('cones').geometry is None


def test_names_ignore_case_and_all_are_listed():
    assert load_scene('adirondack').name == 'Adirondack'
    assert set(SCENES) <= set(list_scenes())


def test_unknown_scene_names_those_that_are_there():
    with pytest.raises(FileNotFoundError, match='nowhere.*Adirondack.*venus'):
        load_scene('nowhere')


@pytest.mark.parametrize('scale, kind', [('-1.0', '<f4'), ('1.0', '>f4')])
def test_pfm_rows_are_bottom_up_in_either_byte_order(tmp_path, scale, kind):
    stored = np.array([[3.5, np.inf], [1.0, 2.0]], kind)
    path = tmp_path / 'map.pfm'
    path.write_bytes(f'Pf\n2 2\n{scale}\n'.encode() + stored.tobytes())
    values = read_pfm(path)
    assert values.dtype == np.float32
    np.testing.assert_array_equal(values, [[1.0, 2.0], [3.5, np.nan]])


@pytest.mark.parametrize('content', [b'PF\n1 1\n-1\n' + bytes(12), b'Pf\n2 2\n-1\n' + bytes(12)])
def test_pfm_of_three_channels_or_cut_short_is_refused(tmp_path, content):
    path = tmp_path / 'map.pfm'
    path.write_bytes(content)
    with pytest.raises(ValueError, match='map.pfm'):
        read_pfm(path)

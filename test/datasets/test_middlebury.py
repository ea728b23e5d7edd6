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

import json

import cv2
import numpy as np
import pytest
from real_scenes import real_scene_folder

from stereo_refine_ros.datasets import list_scenes, load_scene, render_scene
from stereo_refine_ros.datasets.middlebury import read_pfm, read_scene

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


FIELD = {  # shape, kind of the views, density of the truth, its largest disparity
    'kitti2012/000000_10': ((370, 1226), 2, 0.35093, 69.816),
    'kitti2012/000168_10': ((376, 1241), 2, 0.25258, 116.539),
    'eth3d/electro_1s': ((435, 717), 3, 0.75019, 15.471),
    'middlebury/Pipes': ((485, 735), 3, 0.96479, 67.284),
    'middlebury/Reindeer_half': ((555, 671), 3, 0.99426, 100.5),
}


def _warp_error(scene, disparity, seen):
    height, width = scene.pair.shape
    x, y = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    warped = cv2.remap(scene.pair.right, x - disparity, y, cv2.INTER_LINEAR)
    return np.abs(warped.astype(int) - scene.pair.left)[seen].mean()


@pytest.mark.parametrize('name', FIELD)
def test_truth_of_the_field_in_16_bits_and_in_floats(name):
    scene = read_scene(real_scene_folder(f'../field/{name}'))
    shape, dimensions, density, largest = FIELD[name]
    assert (scene.pair.shape, scene.pair.left.ndim) == (shape, dimensions)
    known = np.isfinite(scene.truth)
    assert known.mean() == pytest.approx(density, abs=1e-4)
    assert np.nanmax(scene.truth) == pytest.approx(largest, abs=1e-2)
    truth = np.nan_to_num(scene.truth)
    median = np.full_like(truth, np.nanmedian(scene.truth))
    seen = known & scene.masks.get('nonocc', known)
    assert _warp_error(scene, truth, seen) < 0.6 * _warp_error(scene, median, seen)


@pytest.fixture
def folder(tmp_path):
    """Return a scene without truth; `meta.json` is up to the test."""
    scene = render_scene(1, 32, 48, 16, 1)
    for side, view in (('left', scene.pair.left), ('right', scene.pair.right)):
        cv2.imwrite(str(tmp_path / f'{side}.png'), view)
    return tmp_path


def _describe(folder, **meta):
    (folder / 'meta.json').write_text(json.dumps({'ndisp': 16, **meta}))


@pytest.mark.parametrize('dtype, scale, invalid, marks', [
    ('uint8', 4, 0, [0]), ('uint8', 2.5, None, []), ('uint8', 3, 255, [255]),
    ('uint16', 256, 0, [0]), ('uint16', 64, 65535, [65535]), ('uint16', 100.5, [0, 7], [0, 7]),
    ('uint16', 256, 'inf', []), ('float32', 2, -1, [-1, np.nan, np.inf]),
    ('float32', 1, 'inf', [np.inf, -np.inf])])
def test_truth_of_any_type_scale_and_mark(folder, dtype, scale, invalid, marks):
    disparity = np.linspace(1, 15, 32 * 48).reshape(32, 48)
    levels = np.rint(disparity * scale) if dtype != 'float32' else disparity * scale
    levels = levels.astype(dtype)
    for column, mark in enumerate(marks):
        levels[:, column] = mark
    if dtype == 'float32':
        stored = b'Pf\n48 32\n-1\n' + levels[::-1].astype('<f4').tobytes()
        (folder / 'disp_left.pfm').write_bytes(stored)
    else:
        cv2.imwrite(str(folder / 'disp_left.png'), levels)
    _describe(folder, disp_scale=scale, invalid_value=invalid)
    scene = read_scene(folder)
    assert np.isnan(scene.truth[:, :len(marks)]).all()
    np.testing.assert_allclose(
        scene.truth[:, len(marks):], disparity[:, len(marks):], atol=0.51 / scale)
    # The errors of 8-bit maps need the levels of 8-bit maps.
    assert scene.scale == (scale if dtype == 'uint8' else 1)


def _truth(folder, levels):
    assert cv2.imwrite(str(folder / 'disp_left.png'), levels)


@pytest.mark.parametrize('levels, meta, reason', [
    (np.full((32, 48), 9000, np.uint16), {'disp_scale': 16}, 'largest disparity 562.5 px'),
    (np.zeros((32, 48), np.uint16), {'disp_scale': 16, 'invalid_value': 0}, '0 known pixels'),
    (np.full((32, 48), 9, np.uint8), {}, 'disp_scale in meta.json is None'),
    (np.full((32, 48), 9, np.uint8), {'disp_scale': 0}, 'disp_scale in meta.json is 0'),
    (np.full((16, 24), 9, np.uint8), {'disp_scale': 4}, 'left view has'),
    (np.arange(32 * 48 * 3).astype(np.uint8).reshape(32, 48, 3), {'disp_scale': 4},
     'coloured picture')])
def test_truth_that_does_not_fit_is_refused_by_name(folder, levels, meta, reason):
    _truth(folder, levels)
    _describe(folder, **meta)
    with pytest.raises(ValueError, match='disp_left.png: .*' + reason):
        read_scene(folder)


def test_scene_without_truth_needs_no_scale(folder):
    _describe(folder)
    scene = read_scene(folder)
    assert scene.truth is None and scene.masks == {}


def test_damaged_description_is_named(folder):
    (folder / 'meta.json').write_text('{')
    with pytest.raises(ValueError, match='meta.json'):
        read_scene(folder)


def test_mask_of_16_bits(folder):
    _truth(folder, np.full((32, 48), 900, np.uint16))
    inside = np.zeros((32, 48), np.uint16)
    inside[:, 10:] = 65535
    cv2.imwrite(str(folder / 'mask_nonocc.png'), inside)
    _describe(folder, disp_scale=100)
    np.testing.assert_array_equal(read_scene(folder).masks['nonocc'], inside > 0)


def test_views_of_16_bits_and_of_one_colour_each(folder):
    colour = cv2.imread(str(folder / 'left.png'))
    grey = cv2.cvtColor(cv2.imread(str(folder / 'right.png')), cv2.COLOR_BGR2GRAY)
    cv2.imwrite(str(folder / 'left.png'), colour.astype(np.uint16) * 16)
    cv2.imwrite(str(folder / 'right.png'), grey.astype(np.uint16) * 16)
    _describe(folder)
    pair = read_scene(folder).pair
    assert pair.left.ndim == 2 and pair.left.dtype == np.uint8
    # The same scale for both, and about the 8 bits they came from.
    slope = np.polyfit(grey.ravel(), pair.right.ravel(), 1)[0]
    assert 0.7 < slope < 1.5
    back = cv2.cvtColor(colour, cv2.COLOR_BGR2GRAY)
    assert np.polyfit(back.ravel(), pair.left.ravel(), 1)[0] == pytest.approx(slope, rel=0.02)

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

"""Folders of pairs, in both layouts."""

import shutil

import cv2
import numpy as np
import pytest
from real_scenes import real_scene_folder

from stereo_refine_ros.datasets import iterate_folder
from stereo_refine_ros.datasets.calibration import (
    euroc_geometry, read_euroc, read_projections)
from stereo_refine_ros.datasets.folder import iterate_globs, list_pairs
import yaml


def _write(path, level, channels=3):
    path.parent.mkdir(parents=True, exist_ok=True)
    shape = (4, 6, 3) if channels == 3 else (4, 6)
    cv2.imwrite(str(path), np.full(shape, level, np.uint8))


def test_subfolders_are_paired_by_name(tmp_path):
    for index in (2, 0, 1):
        _write(tmp_path / 'left' / f'{index:06d}.png', 10 * index)
        _write(tmp_path / 'right' / f'{index:06d}.png', 10 * index + 1)
    scenes = list(iterate_folder(tmp_path))
    assert [scene.name for scene in scenes] == ['000000', '000001', '000002']
    assert [scene.pair.left[0, 0, 0] for scene in scenes] == [0, 10, 20]
    assert [scene.pair.right[0, 0, 0] for scene in scenes] == [1, 11, 21]
    assert all(scene.truth is None and scene.geometry is None for scene in scenes)


def test_suffixes_are_paired_and_maps_left_alone(tmp_path):
    for name in ('a_left.png', 'a_right.png', 'b_left.png', 'b_right.png', 'disp_left.png'):
        _write(tmp_path / name, 5, channels=1)
    assert [name for name, _, _ in list_pairs(tmp_path)] == ['a', 'b']
    assert next(iter(iterate_folder(tmp_path))).pair.left.shape == (4, 6)


def test_a_single_pair_is_called_like_its_folder(tmp_path):
    _write(tmp_path / 'desk' / 'left.png', 1)
    _write(tmp_path / 'desk' / 'right.png', 2)
    assert [name for name, _, _ in list_pairs(tmp_path / 'desk')] == ['desk']


def test_calibration_of_two_projection_matrices(tmp_path):
    left = '700 0 320 0 0 700 240 0 0 0 1 0'
    right = '700 0 325 -350 0 700 240 0 0 0 1 0'
    path = tmp_path / 'calib.txt'
    path.write_text(f'{left}\n{right}\n')
    geometry = read_projections(path)
    assert (geometry.focal_px, geometry.baseline_m) == (700.0, 0.5)
    assert (geometry.cx_left, geometry.cx_right, geometry.cy) == (320.0, 325.0, 240.0)


@pytest.mark.parametrize('text', ['cam0=[1 2 3]', '1 2 3\n4 5 6\n', ''])
def test_other_calibration_files_are_left_alone(tmp_path, text):
    (tmp_path / 'calib.txt').write_text(text)
    assert read_projections(tmp_path / 'calib.txt') is None
    assert read_projections(tmp_path / 'absent.txt') is None


def test_16_bits_of_a_sequence_share_one_scale(tmp_path):
    ramp = np.linspace(200, 3800, 24).reshape(4, 6).astype(np.uint16)
    for side in ('left', 'right'):
        (tmp_path / side).mkdir()
        for index, gain in enumerate((1.0, 0.9)):
            cv2.imwrite(str(tmp_path / side / f'{index}.png'), (ramp * gain).astype(np.uint16))
    first, second = (scene.pair.left for scene in iterate_folder(tmp_path))
    assert first.dtype == np.uint8 and first.std() > 50
    np.testing.assert_allclose(second + 12.0, (first + 12.0) * 0.9, atol=3)


def test_missing_partner_and_empty_folder_are_named(tmp_path):
    with pytest.raises(FileNotFoundError, match='no pairs'):
        list_pairs(tmp_path)
    _write(tmp_path / 'left' / 'x.png', 1)
    _write(tmp_path / 'left' / 'y.png', 1)
    _write(tmp_path / 'right' / 'x.png', 1)
    with pytest.raises(FileNotFoundError, match='without a partner: y'):
        list_pairs(tmp_path)


def test_unreadable_image_is_named(tmp_path):
    for side in ('left', 'right'):
        (tmp_path / side).mkdir()
        (tmp_path / side / 'x.png').write_text('no image')
    with pytest.raises(ValueError, match='x.png'):
        next(iterate_folder(tmp_path))


@pytest.mark.parametrize('left, right', [
    ('image_2/000007.png', 'image_3/000007.png'), ('image_0/000007.png', 'image_1/000007.png'),
    ('image_02/data/0000000007.png', 'image_03/data/0000000007.png'),
    ('mav0/cam0/data/1403715273262142976.png', 'mav0/cam1/data/1403715273262142976.png'),
    ('Left/a.jpg', 'Right/a.jpg'), ('left/left_07.png', 'right/right_07.png'),
    ('left_000.png', 'right_000.png'), ('left000.png', 'right000.png'),
    ('scene_Left.png', 'scene_Right.png'), ('im0.png', 'im1.png'), ('LEFT.PNG', 'RIGHT.PNG')])
def test_layouts_of_data_sets_and_of_people(tmp_path, left, right):
    _write(tmp_path / left, 50)
    _write(tmp_path / right, 60)
    for other in ('disp_left.png', 'mask_nonocc.png', 'external_hitnet.png', 'clefts.png'):
        _write(tmp_path / other, 70)
    scene, = iterate_folder(tmp_path)
    assert abs(scene.pair.left.mean() - 50) < 2 and abs(scene.pair.right.mean() - 60) < 2


def test_stamps_without_a_partner_are_left_out(tmp_path):
    """Check EuRoC's cameras do not all start and end with the same frame."""
    for camera, stamps in (('cam0', (1, 2, 3)), ('cam1', (2, 3, 4))):
        for stamp in stamps:
            _write(tmp_path / 'mav0' / camera / 'data' / f'140371527326214297{stamp}.png', stamp)
    assert [name[-1] for name, _, _ in list_pairs(tmp_path)] == ['2', '3']


def test_patterns_pair_what_they_find_in_order(tmp_path):
    for index in range(3):
        _write(tmp_path / f'cam_a_{index}.png', 10 * index)
        _write(tmp_path / 'b' / f'{index + 5}.png', 10 * index + 1)
    scenes = list(iterate_globs(str(tmp_path / 'cam_a_*'), str(tmp_path / 'b' / '*.png')))
    assert [(scene.pair.left[0, 0, 0], scene.pair.right[0, 0, 0]) for scene in scenes] == [
        (0, 1), (10, 11), (20, 21)]
    (tmp_path / 'b' / '5.png').unlink()
    with pytest.raises(FileNotFoundError, match='finds 3 images, --right .* 2'):
        list(iterate_globs(str(tmp_path / 'cam_a_*'), str(tmp_path / 'b' / '*.png')))


def test_what_was_looked_for_is_listed_where_there_is_nothing(tmp_path):
    with pytest.raises(FileNotFoundError, match='image_02/data/.*mav0/cam0/data/.*--left GLOB'):
        list_pairs(tmp_path)
    with pytest.raises(FileNotFoundError, match='no pairs'):
        list_pairs(tmp_path / 'absent')


KITTI = """P0: 700 0 600 0 0 700 180 0 0 0 1 0
P1: 700 0 600 -375.9 0 700 180 0 0 0 1 0
P2: 700 0 600 44.8 0 700 180 0.2 0 0 1 0.003
P3: 700 0 600 -331.1 0 700 180 2.1 0 0 1 0.002
Tr: 1 0 0 0 0 1 0 0 0 0 1 0
"""


@pytest.mark.parametrize('folders, baseline', [
    (('image_2', 'image_3'), 375.9 / 700), (('image_0', 'image_1'), 375.9 / 700)])
def test_kitti_calibration_of_the_cameras_that_are_there(tmp_path, folders, baseline):
    """The colour cameras: both have an offset; the right one's alone is 12 % short."""
    for folder in folders:
        _write(tmp_path / folder / '000000.png', 1)
    (tmp_path / 'calib.txt').write_text(KITTI)
    geometry = next(iterate_folder(tmp_path)).geometry
    assert geometry.baseline_m == pytest.approx(baseline, rel=1e-6)
    assert (geometry.focal_px, geometry.cx_left, geometry.cy) == (700, 600, 180)


def test_kitti_raw_calibration_of_the_day_above_the_drive(tmp_path):
    drive = tmp_path / '2011_09_26_drive_0001_sync'
    for camera in ('02', '03'):
        _write(drive / f'image_{camera}' / 'data' / '0000000000.png', 1)
    text = 'calib_time: 09-Jan-2012 13:57:47\ncorner_dist: 9.95e-02\n' + KITTI.replace(
        'P', 'P_rect_0').replace('Tr: ', 'R_rect_00: ')
    (tmp_path / 'calib_cam_to_cam.txt').write_text(text)
    assert next(iterate_folder(drive)).geometry.baseline_m == pytest.approx(375.9 / 700)


def test_middlebury_calibration(tmp_path):
    _write(tmp_path / 'im0.png', 1)
    _write(tmp_path / 'im1.png', 1)
    (tmp_path / 'calib.txt').write_text(
        'cam0=[999.421 0 294.182; 0 999.421 252.932; 0 0 1]\n'
        'cam1=[999.421 0 326.96; 0 999.421 252.932; 0 0 1]\ndoffs=32.778\nbaseline=193.001\n'
        'width=741\nheight=497\nndisp=70\n')
    geometry = next(iterate_folder(tmp_path)).geometry
    assert (geometry.focal_px, geometry.baseline_m) == (999.421, pytest.approx(0.193001))
    assert geometry.doffs_px == pytest.approx(32.778)


def _row_differences(left, right):
    """Follow corners of the left view into the right one and back; rows between them."""
    corners = cv2.goodFeaturesToTrack(left, 1000, 0.01, 8)
    window = {'winSize': (15, 15), 'maxLevel': 4}
    there, found, _ = cv2.calcOpticalFlowPyrLK(left, right, corners, None, **window)
    back, again, _ = cv2.calcOpticalFlowPyrLK(right, left, there, None, **window)
    is_sure = (found & again).ravel().astype(bool) & (
        np.abs(back - corners).reshape(-1, 2).max(axis=1) < 0.3)
    return (there - corners).reshape(-1, 2)[is_sure, 1]


def test_raw_euroc_pairs_are_rectified():
    folder = real_scene_folder('../sequences/euroc_raw_excerpt')
    scenes = list(iterate_folder(folder))
    assert len(scenes) == 30
    geometry = scenes[0].geometry
    assert geometry.baseline_m == pytest.approx(0.11008, abs=1e-5)
    assert geometry.focal_px == pytest.approx(436.2, abs=1)
    for index in (0, 14, 29):
        rows = _row_differences(scenes[index].pair.left, scenes[index].pair.right)
        assert len(rows) > 80
        assert np.median(np.abs(rows)) < 0.5
        _, left, right = list_pairs(folder)[index]
        raw = _row_differences(*(cv2.imread(str(path), 0) for path in (left, right)))
        assert np.median(np.abs(raw)) > 2


def test_calibration_that_cannot_be_used_is_named(tmp_path):
    folder = real_scene_folder('../sequences/euroc_raw_excerpt') / 'mav0'
    for camera in ('cam0', 'cam1'):
        _write(tmp_path / 'mav0' / camera / 'data' / '1403715273262142976.png', 1)
        shutil.copy(folder / camera / 'sensor.yaml', tmp_path / 'mav0' / camera)
    path = tmp_path / 'mav0' / 'cam1' / 'sensor.yaml'
    path.write_text(path.read_text().replace('pinhole', 'omni'))
    with pytest.raises(ValueError, match='cam1/sensor.yaml.*omni.*expected pinhole'):
        next(iterate_folder(tmp_path))


def test_fisheye_cameras_are_rectified_too(tmp_path):
    """The same rays through an equidistant lens: rows agree after rectification."""
    source = real_scene_folder('../sequences/euroc_raw_excerpt') / 'mav0'
    for camera in ('cam0', 'cam1'):
        (tmp_path / camera).mkdir()
        text = (source / camera / 'sensor.yaml').read_text().replace(
            'radial-tangential', 'equidistant')
        before, _, after = text.partition('distortion_coefficients: [')
        path = tmp_path / camera / 'sensor.yaml'
        path.write_text(f'{before}distortion_coefficients: [0.01, -0.02, 0.005, 0.001]'
                        + after.partition(']')[2])
    left, right = read_euroc(*(tmp_path / camera / 'sensor.yaml' for camera in ('cam0', 'cam1')))
    assert (left.distortion_model, len(left.d)) == ('equidistant', 4)
    assert euroc_geometry((left, right)).baseline_m == pytest.approx(0.11008, abs=1e-5)
    # One point before both cameras lies on one row of the rectified views.
    poses = [np.array(yaml.safe_load((tmp_path / camera / 'sensor.yaml').read_text())[
        'T_BS']['data']).reshape(4, 4) for camera in ('cam0', 'cam1')]
    point = poses[0] @ [0.3, -0.2, 2.0, 1.0]
    rows = []
    for model, pose in zip((left, right), poses, strict=True):
        ray = np.array(model.r).reshape(3, 3) @ (np.linalg.inv(pose) @ point)[:3]
        projected = np.array(model.p).reshape(3, 4)[:, :3] @ ray
        rows.append(projected[1] / projected[2])
    assert rows[0] == pytest.approx(rows[1], abs=0.01)

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

import cv2
import numpy as np
import pytest

from stereo_refine_ros.datasets import iterate_folder
from stereo_refine_ros.datasets.folder import list_pairs, read_projections


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

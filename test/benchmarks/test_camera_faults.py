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

"""The faults of the benchmark do what they say; its table says what was measured."""

import argparse

import camera_faults
import cv2
import faults_of_cameras
import numpy as np
import pytest
from stereo_refine_ros.datasets.scene import Scene
from stereo_refine_ros.types import StereoPair


def views(channels=3):
    noise = np.random.default_rng(0).normal(size=(60, 90, channels))
    smooth = cv2.GaussianBlur(noise, (0, 0), 3).reshape(60, 90, channels)
    image = np.rint(128 + 40 * smooth / smooth.std()).clip(0, 255).astype(np.uint8)
    image = image[..., 0] if channels == 1 else image
    return image, image.copy()


@pytest.mark.parametrize('name', list(faults_of_cameras.FAULTS))
@pytest.mark.parametrize('channels', [1, 3])
def test_faults_make_views_and_leave_the_clean_ones(name, channels):
    left, right = views(channels)
    kept = left.copy()
    first, second = faults_of_cameras.FAULTS[name](left, right)
    assert first.dtype == second.dtype == np.uint8
    assert first.shape == second.shape
    assert np.array_equal(left, kept) and np.array_equal(right, kept)
    if name.startswith('right'):
        assert np.array_equal(first, left)
    is_same = np.array_equal(second, right)
    needs_colour = name in ('grey', 'right white balance')
    assert is_same == (name == 'clean' or (channels == 1 and needs_colour))


def test_whole_rows_and_levels():
    left, right = views()
    lower = faults_of_cameras.FAULTS['right 2 rows lower'](left, right)[1]
    assert np.array_equal(lower[2:], right[:-2])
    dim = faults_of_cameras.FAULTS['right gain 0.8 - 8'](left, right)[1]
    assert np.array_equal(dim, np.rint(0.8 * right - 8).clip(0, 255))
    plain = np.full((100, 100), 100, np.uint8)
    assert faults_of_cameras.vignette(plain)[0, 0] == 60
    assert faults_of_cameras.vignette(plain)[50, 50] == 100


def test_noise_has_its_size_and_differs_between_the_views():
    plain = np.full((200, 200), 128, np.uint8)
    first, second = faults_of_cameras.FAULTS['noise sigma 5'](plain, plain)
    assert first.std() == pytest.approx(5, rel=0.05)
    assert (first.astype(float) - second).std() == pytest.approx(5 * 2 ** 0.5, rel=0.05)
    dark, _ = faults_of_cameras.FAULTS['dark (x 0.12, noise 1.2)'](plain, plain)
    assert dark.mean() == pytest.approx(0.12 * 128, abs=0.1)


def test_row_offset_of_a_fault():
    assert faults_of_cameras.row_offset_of('right 0.5 row lower', 640) == 0.5
    assert faults_of_cameras.row_offset_of('right turned 0.2 degrees', 640) == pytest.approx(
        1.115, abs=0.001)
    assert faults_of_cameras.row_offset_of('noise sigma 5', 640) == 0.0


def test_table_has_means_ratios_and_offsets():
    rows = [{'scene': scene, 'fault': fault, 'method': method, 'bad': bad, 'row_offset_px': found,
             'row_offset_put_in_px': put_in}
            for fault, put_in in (('clean', 0.0), ('right 1 row lower', 1.0))
            for scene, found in (('a', put_in), ('b', put_in + 0.2))
            for method, bad in (('SGBM 3-way', 10.0 + 5 * put_in), ('live', 8.0 + 2 * put_in))]
    assert camera_faults.table(rows).splitlines()[2:] == [
        '| clean | 10.0 (1.00) | 8.0 (1.00) | 0.00 | 0.10 |',
        '| right 1 row lower | 15.0 (1.50) | 10.0 (1.25) | 1.00 | 1.10 |']


def test_without_the_clean_pair_there_is_no_ratio():
    row = {'scene': 'a', 'fault': 'grey', 'method': 'live', 'bad': 8.0, 'row_offset_px': 0.0,
           'row_offset_put_in_px': 0.0}
    assert camera_faults.table([row]).splitlines()[2] == '| grey | 8.0 (-) | 0.00 | 0.00 |'


@pytest.mark.compiled
def test_one_scene_is_measured_by_every_method():
    left = cv2.resize(views()[0], (180, 120), interpolation=cv2.INTER_CUBIC)
    scene = Scene('made up', StereoPair(left, np.roll(left, -4, axis=1)),
                  np.full((120, 180), 4, np.float32), num_disparities=16)
    rows = list(camera_faults.measure(scene, 'clean', ['live'], 1.0, {}))
    assert [row['method'] for row in rows] == ['SGBM 3-way', '+ weighted median', 'live']
    assert all(row['bad'] <= 12 for row in rows)
    assert {row['fault'] for row in rows} == {'clean'}


def test_scene_without_truth_is_refused():
    scene = Scene('made up', StereoPair(*views()))
    with pytest.raises(ValueError, match='made up: has no ground truth'):
        list(camera_faults.measure(scene, 'clean', ['live'], 1.0, {}))


def test_faults_are_chosen_by_their_beginning():
    assert camera_faults._faults('clean,noise') == ['clean', 'noise sigma 5', 'noise sigma 10']
    with pytest.raises(argparse.ArgumentTypeError, match="no fault begins with 'rain'"):
        camera_faults._faults('rain')
    with pytest.raises(argparse.ArgumentTypeError, match="'fast' is none of"):
        camera_faults._presets('live,fast')

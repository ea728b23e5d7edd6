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

"""The demo as a user runs it: two processes, messages, pictures, an end of its own."""

import re
import subprocess
import sys

import cv2
import numpy as np
import pytest

from stereo_refine_ros.datasets import load_scene

pytestmark = pytest.mark.ros


def _demo(folder, *options):
    return subprocess.run(
        [sys.executable, '-m', 'demo', '--output', str(folder),
         '--seconds', '2', *options], capture_output=True, text=True, timeout=120)


def test_demo_ends_by_itself_with_pictures(tmp_path):
    done = _demo(tmp_path, '--scene', 'cones')
    assert done.returncode == 0, done.stdout + done.stderr
    assert 'frame 1: bad_1_0' in done.stdout
    assert _found_offset(done.stdout) == pytest.approx(1.5, abs=0.25)
    scene = load_scene('cones')
    pictures = {path.stem: cv2.imread(str(path)) for path in tmp_path.glob('*.png')}
    assert set(pictures) == {'left', 'preliminary', 'refined', 'ground_truth', 'segments',
                             'error_preliminary', 'error_refined', 'confidence', 'side_by_side'}
    np.testing.assert_array_equal(pictures['left'], scene.pair.left)
    valid = (pictures['refined'] != 0).any(axis=2)
    assert valid.mean() > 0.8
    white = (pictures['error_refined'] > 150).all(axis=2) & np.isfinite(scene.truth)
    assert white.mean() > 0.7  # most pixels are within a pixel of the truth


def _found_offset(printed):
    return float(re.search(
        r'^synthetic: the right image is 1\.50 px lower .*: found (\d\.\d\d) px, undone$',
        printed, re.MULTILINE)[1])


def test_demo_without_scenes_takes_the_synthetic_one(tmp_path):
    done = _demo(tmp_path, '--scene', 'nowhere')
    assert done.returncode == 0, done.stdout + done.stderr
    assert "scene 'nowhere'" in done.stdout and 'synthetic' in done.stdout
    assert cv2.imread(str(tmp_path / 'left.png')).shape == (240, 320, 3)
    assert _found_offset(done.stdout) == pytest.approx(1.5, abs=0.25)


def test_demo_says_why_when_the_node_ends(tmp_path):
    done = _demo(tmp_path, '--scene', 'synthetic', '--preset', 'nonsense')
    assert done.returncode == 1
    assert 'refine_node ended with status' in done.stderr
    assert 'nonsense' in done.stderr
    assert list(tmp_path.glob('*.png')) == []

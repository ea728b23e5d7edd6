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

"""Photometric figures on real scenes: the better map has the better figures."""

import pytest
from real_scenes import real_scene_folder
from stereo_refine_ros.datasets import load_scene
from stereo_refine_ros.params import load_preset
from stereo_refine_ros.pipeline import StereoRefiner
from stereo_refine_ros.quality.photometric import compare_photometric


# Not Tsukuba, whose truth is whole pixels; nor Sawtooth, where it is photometrically worse than
# the matcher's map inside the planes too; nor Dolls, whose PSNR differs by 0.07 dB only.
@pytest.mark.parametrize('name', ['Adirondack', 'Art', 'cones', 'teddy', 'venus'])
def test_truth_scores_better_than_the_matcher(name):
    real_scene_folder(name)
    scene = load_scene(name)
    params = load_preset('live', {
        'matching.method': 'sgbm', 'matching.num_disparities': scene.num_disparities,
        'planes.projection': 'off', 'filter.method': 'none'})
    matched = StereoRefiner(params).process(scene.pair.left, scene.pair.right).preliminary
    before, after = compare_photometric(scene.pair, matched.values, scene.truth)
    assert after.psnr > before.psnr
    assert after.ssim > before.ssim

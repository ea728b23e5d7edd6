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

"""Real scenes: good maps from outside are kept, and matchers' maps are not taken for such."""

from external_maps import map_with_blobs, network_map, slow_noise
import numpy as np
import pytest
from real_scenes import real_scene_folder

from stereo_refine_ros.datasets import load_scene
from stereo_refine_ros.params import load_preset
from stereo_refine_ros.pipeline import StereoRefiner
from stereo_refine_ros.quality.disparity_errors import bad_percent
from stereo_refine_ros.refinement import trust
from stereo_refine_ros.refinement.filling import fill_from_background

SCENES = ('tsukuba', 'venus', 'teddy', 'cones', 'Art', 'Dolls', 'sawtooth', 'Adirondack')


@pytest.fixture(params=SCENES)
def scene(request):
    path = real_scene_folder(request.param)
    return load_scene(path.name, path.parent)


def refined(scene, values, preset):
    params = load_preset(preset, {'matching.method': 'external',
                                  'matching.num_disparities': scene.num_disparities})
    return StereoRefiner(params).process(
        scene.pair.left, scene.pair.right, values).disparity.values


@pytest.mark.parametrize('preset', ['live', 'accurate'])
def test_a_good_map_is_not_made_worse(scene, preset):
    slow = slow_noise(np.random.default_rng(0), scene.truth.shape, 8)
    for values in (scene.truth, network_map(fill_from_background(scene.truth), slow)):
        before, after = (bad_percent(fill_from_background(each), scene.truth, 1.0)
                         for each in (values, refined(scene, values, preset)))
        assert before < 0.01 and after < before + 0.06


@pytest.mark.parametrize('preset', ['live', 'accurate'])
def test_what_is_plainly_wrong_in_a_good_map_is_found(scene, preset):
    slow = slow_noise(np.random.default_rng(1), scene.truth.shape, 10)
    values = map_with_blobs(fill_from_background(scene.truth), slow)
    before, after = (bad_percent(each, scene.truth, 1.0)
                     for each in (values, refined(scene, values, preset)))
    assert 3.0 < before < 5.1 and after < 0.9 * before


def test_the_shares_of_steps_at_edges_are_far_apart(scene):
    def least_share(values):
        steps, hits = trust.count_steps(values, scene.pair.left)
        return (hits / np.maximum(steps, 1)).min()

    params = load_preset('live', {
        'matching.method': 'sgbm', 'matching.num_disparities': scene.num_disparities,
        'planes.projection': 'off', 'filter.method': 'none'})
    matched = StereoRefiner(params).process(scene.pair.left, scene.pair.right).preliminary.values
    assert least_share(matched) < trust._TRUSTED_SHARE - 0.1
    assert least_share(scene.truth) > trust._TRUSTED_SHARE + 0.04
    assert not trust.follows_edges(matched, scene.pair.left)
    assert trust.follows_edges(scene.truth, scene.pair.left)

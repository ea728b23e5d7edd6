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

"""The paper's claim with the preset `paper`: planes lower the error in all its 24 combinations."""

import os

import pytest
from real_scenes import real_scene_folder

from stereo_refine_ros.datasets import load_scene
from stereo_refine_ros.evaluation.runner import evaluate_scene, Plan

MATCHINGS = ('segment_tree', 'non_local')
FILTERS = ('weighted_median', 'guided', 'trilateral', 'box')


@pytest.mark.skipif(os.environ.get('NUMBA_DISABLE_JIT') == '1', reason='full-size images')
@pytest.mark.parametrize('scene', ['cones', 'teddy', 'venus'])
def test_planes_lower_the_error_and_add_no_wrong_pixels(scene):
    folder = real_scene_folder(scene)
    plan = Plan(preset='paper', matchings=MATCHINGS, filters=FILTERS, repeat=1)
    outcomes = evaluate_scene(load_scene(scene, folder.parent), plan)
    rows = [row for outcome in outcomes for row in outcome.rows]
    stages = {stage: {(row['matching'], row['filter']): row
                      for row in rows if row['stage'] == stage}
              for stage in ('before', 'after')}
    assert len(stages['before']) == len(stages['after']) == len(MATCHINGS) * len(FILTERS)
    for combination, before in stages['before'].items():
        after = stages['after'][combination]
        assert after['mse'] < before['mse'], combination
        assert after['psnr'] > before['psnr'], combination
        assert after['bad_1_0'] <= before['bad_1_0'] + 0.05, combination
        assert after['ssim'] > before['ssim'], combination

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

"""Every combination runs, every stage is measured, and the figures are the maps' own."""

from dataclasses import replace
import json
import math

import numpy as np
import pytest
from scene_folder import small_scene

from stereo_refine_ros.evaluation.runner import (
    as_json, Combination, CONFIDENCE, evaluate_scene, judge_confidence, measure_stage, Plan,
    scene_scale, STAGES)
from stereo_refine_ros.pipeline import StereoRefiner
from stereo_refine_ros.refinement.filling import fill_from_background

KEYS = {'scene', 'matching', 'filter', 'projection', 'stage', 'mse', 'psnr', 'ssim',
        'mse_all_pixels', 'psnr_all_pixels', 'bad_0_5', 'bad_1_0', 'bad_2_0', 'bad_3_0',
        'avg_error', 'nonocc', 'all', 'disc', 'density', 'ms', 'confidence_area',
        'confidence_area_best', 'calibration_error', 'density_at_5', 'sure_share', 'sure_wrong'}


@pytest.fixture(scope='module')
def scene():
    return small_scene()


@pytest.fixture(scope='module')
def outcomes(scene):
    plan = Plan('live', matchings=['sgbm'], filters=['none', 'weighted_median'],
                projections=['full', 'guarded'], repeat=1)
    return list(evaluate_scene(scene, plan))


def test_every_combination_has_its_three_rows(outcomes):
    assert [str(outcome.combination) for outcome in outcomes] == [
        'sgbm + none, full', 'sgbm + none, guarded',
        'sgbm + weighted_median, full', 'sgbm + weighted_median, guarded']
    for outcome in outcomes:
        assert [row['stage'] for row in outcome.rows] == list(STAGES)
        for row in outcome.rows:
            assert set(row) == KEYS
            assert row['scene'] == 'synthetic'
            assert Combination(row['matching'], row['filter'], row['projection']
                               ) == outcome.combination


def test_stages_are_the_pipelines_maps(scene, outcomes):
    outcome = outcomes[3]
    params = Plan('live').params(outcome.combination, 16)
    result = StereoRefiner(params).process(scene.pair.left, scene.pair.right)
    without = StereoRefiner(params.updated({'planes.projection': 'off'}))
    normal_flow = without.process(scene.pair.left, scene.pair.right)
    for row, values in zip(outcome.rows, (
            result.preliminary.values, normal_flow.disparity.values, result.disparity.values),
            strict=True):
        assert {name: row[name] for name in measure_stage(values, scene)
                } == measure_stage(values, scene)


def test_confidence_is_judged_with_the_map_it_belongs_to(scene, outcomes):
    outcome = outcomes[3]
    preliminary, before, after = outcome.rows
    assert {preliminary[name] for name in CONFIDENCE} == {None}
    for row, result in ((before, outcome.before), (after, outcome.after)):
        expected = judge_confidence(result.confidence, result.disparity.values, scene)
        assert {name: row[name] for name in CONFIDENCE} == expected
        assert 0 <= row['confidence_area_best'] <= row['confidence_area'] <= 1


def test_confidence_counts_within_the_region_all(scene):
    values, confidence = scene.truth.copy(), np.full(scene.truth.shape, 0.95, np.float32)
    values[:, :48] += 2
    left_half = np.zeros(values.shape, bool)
    left_half[:, :48] = True
    inside = replace(scene, masks={'all': left_half})
    assert judge_confidence(confidence, values, scene)['sure_wrong'] == 0.5
    assert judge_confidence(confidence, values, inside)['sure_wrong'] == 1.0
    without = judge_confidence(np.zeros((0, 0), np.float32), values, scene)
    assert without == dict.fromkeys(CONFIDENCE)


def test_times_belong_to_the_stage(outcomes):
    preliminary, before, after = outcomes[0].rows
    assert set(preliminary['ms']) == {'matching'}
    assert set(before['ms']) == {'matching', 'filter'}
    assert set(after['ms']) == {'matching', 'segmentation', 'planes', 'filter'}
    assert min(after['ms'].values()) >= 0


def test_regions_count_wrong_pixels_by_their_masks(scene):
    values = scene.truth.copy()
    wrong = np.zeros(values.shape, bool)
    wrong[:8, :40] = True
    values[wrong] += 1.5
    figures = measure_stage(values, scene)
    visible = scene.masks['nonocc']
    assert figures['all'] == pytest.approx(100 * wrong.mean())
    assert figures['bad_1_0'] == figures['all']
    assert figures['nonocc'] == pytest.approx(100 * wrong[visible].mean())
    assert figures['disc'] is None


def test_holes_are_filled_before_measuring(scene):
    values = scene.truth.copy()
    values[:, 20:30] = np.nan
    figures, filled = measure_stage(values, scene), fill_from_background(values)
    assert figures['density'] == pytest.approx(1 - 10 / 96)
    for name in ('mse', 'bad_1_0', 'avg_error', 'nonocc'):
        assert figures[name] == measure_stage(filled, scene)[name]


def test_scale_is_the_data_sets_own(scene):
    assert scene_scale(replace(scene, scale=4)) == 4
    assert scene_scale(replace(scene, scale=1, num_disparities=73)) == 3
    assert scene_scale(replace(scene, scale=1, num_disparities=None)) == 1


def test_search_range_comes_from_the_scene_unless_given():
    combination = Combination('sgbm', 'none', 'off')
    assert Plan().params(combination, 60).matching.num_disparities == 60
    given = Plan(overrides={'matching.num_disparities': 40})
    assert given.params(combination, 60).matching.num_disparities == 40


def test_plan_refuses_what_cannot_run():
    with pytest.raises(ValueError, match='nonsense'):
        Plan(matchings=['nonsense'])
    with pytest.raises(ValueError, match='external'):
        Plan(matchings=['external'])
    with pytest.raises(ValueError, match='segmentation.kk'):
        Plan(overrides={'segmentation.kk': 3})


def test_scene_without_truth_is_refused(scene):
    with pytest.raises(ValueError, match='no ground truth'):
        next(evaluate_scene(replace(scene, truth=None), Plan()))


def test_json_is_strict(outcomes):
    rows = [{**outcomes[0].rows[0], 'psnr': math.inf, 'avg_error': math.nan}]
    read = json.loads(json.dumps(as_json(rows), allow_nan=False))[0]
    assert (read['psnr'], read['avg_error'], read['disc']) == (None, None, None)
    assert read['mse'] == rows[0]['mse']
    assert read['ms'] == rows[0]['ms']

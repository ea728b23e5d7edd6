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

"""Non-local and segment tree: on rendered planes, on hand-made pairs, and their anchors."""

import os

import numpy as np
import pytest
from real_scenes import real_scene_folder

from stereo_refine_ros.datasets import load_scene
from stereo_refine_ros.datasets.synthetic import render_scene
from stereo_refine_ros.matching import compute_match
from stereo_refine_ros.matching.match import Match
from stereo_refine_ros.params import MatchingParams
from stereo_refine_ros.quality.disparity_errors import bad_percent
from stereo_refine_ros.types import DisparityMap, StereoPair

METHODS = ('non_local', 'segment_tree')
# Search range of the evaluation, and what the matcher with refinement has to reach.
V2_SCENES = {'tsukuba': 16, 'venus': 20, 'teddy': 60, 'cones': 60}
ANCHORS = {'non_local': 5.5, 'segment_tree': 5.6}


@pytest.fixture(scope='module')
def scene():
    return render_scene(seed=1, height=60, width=90, num_disparities=16)


def params(method, **changes):
    return MatchingParams(method=method, num_disparities=16, **changes)


@pytest.mark.parametrize('second_pass', [False, True])
@pytest.mark.parametrize('method', METHODS)
def test_refined_map_is_dense_whole_and_near_the_truth(scene, method, second_pass):
    match = compute_match(scene.pair, params(method, second_pass=second_pass), 2)
    values = match.disparity.values
    assert values.dtype == np.float32
    np.testing.assert_array_equal(values, np.rint(values))
    assert bad_percent(values, scene.truth, 1.0, scene.masks['nonocc']) < 16


@pytest.mark.parametrize('method', METHODS)
def test_unrefined_map_is_the_checked_subpixel_one(scene, method):
    match = compute_match(scene.pair, params(method, nonlocal_refinement=False))
    refined = compute_match(scene.pair, params(method))
    np.testing.assert_array_equal(match.disparity.values, match.subpixel)
    np.testing.assert_array_equal(match.subpixel, refined.subpixel)
    found = np.isfinite(match.subpixel)
    assert 0.5 < found.mean() < 1
    assert bad_percent(match.subpixel, scene.truth, 1.0, found & scene.masks['nonocc']) < 8
    assert np.any(match.subpixel[found] % 1 != 0)


def test_subpixel_is_closer_to_slanted_planes_than_whole_pixels(scene):
    match = compute_match(scene.pair, params('non_local'))
    error = np.abs(match.subpixel - scene.truth)
    whole = np.abs(np.rint(match.subpixel) - scene.truth)
    inside = error < 1
    assert error[inside].mean() < 0.8 * whole[inside].mean()


def test_a_match_says_by_how_much_it_was_rounded(scene):
    whole = compute_match(scene.pair, params('non_local'))
    assert whole.rounding == 0.5
    finer = compute_match(scene.pair, params('non_local', nonlocal_refinement=False))
    assert finer.rounding == 0
    values = np.float32([[3, np.nan], [7, 12]])
    given = Match(DisparityMap(values, 0, 64), is_own=False)
    assert given.rounding == 0.5
    values[1, 1] = 12.25
    assert given.rounding == 0


def test_the_check_fails_where_the_right_view_sees_something_else(scene):
    match = compute_match(scene.pair, params('non_local'))
    found = np.isfinite(match.subpixel)
    seen = scene.masks['nonocc']
    hidden = np.isfinite(scene.truth) & ~seen
    assert found[seen].mean() > 0.7 and found[hidden].mean() < 0.35
    assert match.lr_consistent_ratio == found.mean()


@pytest.mark.parametrize('method', METHODS)
def test_threads_do_not_change_the_result(scene, method):
    one, two = (compute_match(scene.pair, params(method), n) for n in (1, 2))
    np.testing.assert_array_equal(one.disparity.values, two.disparity.values)
    np.testing.assert_array_equal(one.subpixel, two.subpixel)


@pytest.mark.parametrize('shift', [-5, 6])
def test_negative_ranges_and_grey_images(shift):
    left = np.random.default_rng(2).integers(0, 256, (20, 50), dtype=np.uint8)
    pair = StereoPair(left, np.roll(left, -shift, axis=1))
    matching = MatchingParams(method='non_local', min_disparity=-9, num_disparities=21)
    match = compute_match(pair, matching)
    inside = slice(8, -8)
    assert np.all(match.disparity.values[:, inside] == shift)


@pytest.mark.parametrize('shape', [(1, 1, 3), (1, 9), (7, 1), (4, 5, 3)])
@pytest.mark.parametrize('count', [1, 12])
def test_images_narrower_than_the_range(shape, count):
    image = np.random.default_rng(3).integers(0, 256, shape, dtype=np.uint8)
    matching = MatchingParams(method='segment_tree', num_disparities=count)
    values = compute_match(StereoPair(image, image), matching, 2).disparity.values
    assert values.shape == shape[:2]
    assert np.all((values >= 0) & (values < count))


@pytest.mark.skipif(os.environ.get('NUMBA_DISABLE_JIT') == '1', reason='full-size images')
@pytest.mark.parametrize('method', METHODS)
def test_average_over_the_v2_evaluation_reaches_the_anchor(method):
    folders = {name: real_scene_folder(name) for name in V2_SCENES}
    columns = []
    for name, count in V2_SCENES.items():
        scene = load_scene(name, folders[name].parent)
        values = compute_match(
            scene.pair, MatchingParams(method=method, num_disparities=count), 2).disparity.values
        columns += [bad_percent(values, scene.truth, 1.0, scene.masks[region])
                    for region in ('nonocc', 'all', 'disc')]
    assert np.mean(columns) <= ANCHORS[method]

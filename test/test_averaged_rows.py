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

"""Averaged rows: a map of full size is matched and measured there, and refined on fewer rows."""

import numpy as np
import pytest

from stereo_refine_ros.datasets.synthetic import render_scene
from stereo_refine_ros.matching import compute_match, OPENCV_MATCHERS
from stereo_refine_ros.params import load_preset
from stereo_refine_ros.pipeline import StereoRefiner
from stereo_refine_ros.quality.disparity_errors import bad_percent
from stereo_refine_ros.refinement.filling import fill_from_background

AVERAGED = {'processing.max_cells': 0.001, 'processing.min_rows': 40,
            'matching.num_disparities': 24}


@pytest.fixture(scope='module')
def scene():
    return render_scene(seed=2, height=120, width=160, num_disparities=24)


def refiner(method, **values):
    return StereoRefiner(load_preset('live', {'matching.method': method, **AVERAGED, **values}))


@pytest.mark.parametrize('method', OPENCV_MATCHERS)
def test_a_matcher_of_opencv_matches_every_row(scene, method):
    averaged = refiner(method)
    result = averaged.process(scene.pair.left, scene.pair.right)
    whole = compute_match(scene.pair, averaged.params.matching)
    np.testing.assert_array_equal(result.preliminary.values, whole.disparity.values)
    assert result.lr_consistent_ratio == np.isfinite(whole.fit_data).mean()
    before, after = (bad_percent(fill_from_background(each.values), scene.truth, 1.0)
                     for each in (result.preliminary, result.disparity))
    assert after < 0.7 * before


@pytest.mark.parametrize('method', OPENCV_MATCHERS)
@pytest.mark.parametrize('projection', ['full', 'guarded', 'off'])
def test_it_is_refined_as_the_same_map_from_outside(scene, method, projection):
    averaged = refiner(method, **{'planes.projection': projection})
    own = averaged.process(scene.pair.left, scene.pair.right)
    external = averaged.process(scene.pair.left, scene.pair.right, own.preliminary.values)
    np.testing.assert_array_equal(own.disparity.values, external.disparity.values)
    np.testing.assert_array_equal(own.segments.planes, external.segments.planes)


@pytest.mark.parametrize('method', ['sgbm', 'scanline'])
@pytest.mark.parametrize('ratio', [0.5, 0.97])
def test_full_projection_puts_every_pixel_of_a_fitted_segment_on_its_plane(scene, method, ratio):
    result = refiner(method, **{
        'planes.projection': 'full', 'planes.min_inlier_ratio': ratio, 'filter.method': 'none',
    }).process(scene.pair.left, scene.pair.right)
    segments, values = result.segments, result.disparity.values
    fitted = segments.is_fitted[segments.labels]
    assert fitted.mean() > 0.3 and (ratio < 0.9 or fitted.mean() < 0.9)
    y, x = np.nonzero(fitted)
    a, b, c = segments.planes[segments.labels[fitted]].T
    np.testing.assert_allclose(values[fitted], np.clip(a * x + b * y + c, 0, 23), atol=1e-5)
    if method == 'sgbm':
        np.testing.assert_array_equal(values[~fitted], result.preliminary.values[~fitted])


def test_other_matchers_match_averaged_rows(scene):
    result = refiner('scanline').process(scene.pair.left, scene.pair.right)
    rows = result.preliminary.values.reshape(40, 3, 160)
    np.testing.assert_array_equal(rows, np.repeat(rows[:, :1], 3, axis=1))

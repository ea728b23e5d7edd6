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

"""Maps from outside through the whole method, and the three projections."""

import numpy as np
import pytest
from refined_pairs import assert_same, assert_sound, bad_ratio, GRIDS, noisy_truth, RANGE
from refined_pairs import refine, views

from stereo_refine_ros.datasets.synthetic import render_scene
from stereo_refine_ros.params import PRESETS, PROJECTIONS

SHAPE = (120, 160)


@pytest.fixture(scope='module')
def scene():
    return render_scene(seed=0, height=120, width=160, num_disparities=RANGE)


@pytest.mark.parametrize('preset', PRESETS)
@pytest.mark.parametrize('has_right', [True, False])
@pytest.mark.parametrize('pixels', GRIDS)
def test_an_external_map_is_refined_with_and_without_the_right_view(
        scene, preset, has_right, pixels):
    left, right = views(scene)
    external = noisy_truth(scene)
    result = refine((left, right if has_right else None), preset, external,
                    matching__method='external', processing__refine_pixels=pixels)
    assert_sound(result, SHAPE, 0, RANGE)
    np.testing.assert_array_equal(result.preliminary.values, external)
    assert bad_ratio(result.disparity.values, scene.truth) < 0.05
    assert result.disparity.valid_ratio == 1.0
    assert np.isnan(result.lr_consistent_ratio)


def test_an_external_map_of_doubles_is_taken_and_its_infinities_are_holes(scene):
    external = noisy_truth(scene, np.float64)
    expected = refine(views(scene), preliminary=external)
    assert expected.preliminary.values.dtype == np.float32
    external[np.isnan(external)] = np.inf
    external[60:] = np.where(np.isinf(external[60:]), -np.inf, external[60:])
    assert_same(refine(views(scene), preliminary=external), expected)


@pytest.mark.parametrize('external', [
    np.zeros((5, 5), np.float32), np.zeros((120, 160, 1), np.float32), [[1.0]], 'map'])
def test_an_external_map_of_another_shape_or_type_is_refused(scene, external):
    with pytest.raises(ValueError, match=r'preliminary: expected .*\(120, 160\)'):
        refine(views(scene), preliminary=external)


@pytest.mark.parametrize('projection', PROJECTIONS)
@pytest.mark.parametrize('has_right', [True, False])
@pytest.mark.parametrize('pixels', GRIDS)
def test_a_map_without_a_valid_pixel_stays_one(scene, projection, has_right, pixels):
    left, right = views(scene)
    result = refine(
        (left, right if has_right else None), preliminary=np.full(SHAPE, np.nan, np.float32),
        planes__projection=projection, processing__refine_pixels=pixels)
    assert_sound(result, SHAPE, 0, RANGE)
    assert not result.disparity.valid.any()
    assert not result.segments.is_fitted.any()
    assert np.all(result.confidence == 0)


@pytest.mark.parametrize('pixels', GRIDS)
@pytest.mark.parametrize('projection', PROJECTIONS)
def test_one_valid_pixel_is_no_reason_to_fail(scene, projection, pixels):
    external = np.full(SHAPE, np.nan, np.float32)
    external[50, 70] = 9.5
    result = refine((scene.pair.left, None), preliminary=external, planes__projection=projection,
                    filter__method='none', processing__refine_pixels=pixels)
    expected = np.full_like(external, 9.5) if projection == 'guarded' else external
    np.testing.assert_array_equal(result.disparity.values, expected)


@pytest.mark.parametrize('has_right', [True, False])
def test_nothing_said_away_from_the_matches_is_sure(scene, has_right):
    left, right = views(scene)
    wrong = np.random.default_rng(0).uniform(0, RANGE - 1, SHAPE).astype(np.float32)
    noise = refine((left, right if has_right else None), preliminary=wrong)
    good = refine((left, right if has_right else None), preliminary=scene.truth)
    assert good.confidence.mean() > noise.confidence.mean() + 0.1


@pytest.mark.parametrize('pixels', GRIDS)
def test_without_projection_and_filter_nothing_changes(scene, pixels):
    result = refine(views(scene), planes__projection='off', filter__method='none',
                    processing__refine_pixels=pixels)
    np.testing.assert_array_equal(result.disparity.values, result.preliminary.values)
    assert np.isnan(result.segments.planes).all()
    assert not result.segments.is_fitted.any()
    assert_sound(result, SHAPE, 0, RANGE)


def test_full_projection_puts_every_pixel_of_a_fitted_segment_on_its_plane(scene):
    result = refine(views(scene), planes__projection='full', filter__method='none',
                    processing__refine_pixels=1.0)
    segments = result.segments
    y, x = np.indices(SHAPE)
    a, b, c = segments.planes[segments.labels].transpose(2, 0, 1)
    expected = np.clip(a * x + b * y + c, 0, RANGE - 1).astype(np.float32)
    on_plane = segments.is_fitted[segments.labels]
    assert 0.3 < on_plane.mean() < 1
    np.testing.assert_array_equal(result.disparity.values[on_plane], expected[on_plane])
    np.testing.assert_array_equal(
        result.disparity.values[~on_plane], result.preliminary.values[~on_plane])


def test_planes_of_the_half_are_in_pixels_of_the_image(scene):
    result = refine(views(scene), processing__refine_pixels=0.0)
    segments = result.segments
    y, x = np.indices(SHAPE)
    a, b, c = segments.planes[segments.labels].transpose(2, 0, 1)
    on_plane = segments.is_fitted[segments.labels]
    assert on_plane.mean() > 0.6
    error = np.abs(a * x + b * y + c - scene.truth)[on_plane]
    assert np.median(error) < 0.2
    assert np.mean(error > 1.0) < 0.08
    # Every pixel of a pixel of the grid belongs to one segment.
    np.testing.assert_array_equal(segments.labels[::2, ::2], segments.labels[1::2, 1::2])

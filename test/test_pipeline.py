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

"""The whole method: repeatable, read-only, better than what it started from, never off limits."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from stereo_refine_ros.datasets.synthetic import render_scene
from stereo_refine_ros.params import load_preset, MATCHERS, PRESETS
from stereo_refine_ros.pipeline import StereoRefiner

STAGES = {'matching', 'segmentation', 'planes', 'filter'}
RANGE = 24
REFINED_MATCHERS = [method for method in MATCHERS if method != 'external']


@pytest.fixture(scope='module')
def scene():
    return render_scene(seed=0, height=120, width=160, num_disparities=RANGE)


def refine(pair, preset='live', preliminary=None, **values):
    """Run a preset; `a__b` stands for the parameter a.b."""
    dotted = {'matching.num_disparities': RANGE}
    dotted |= {name.replace('__', '.'): value for name, value in values.items()}
    return StereoRefiner(load_preset(preset, dotted)).process(*pair, preliminary=preliminary)


def views(scene):
    return scene.pair.left, scene.pair.right


def assert_same(a, b):
    """Compare two results bit for bit, times aside."""
    np.testing.assert_array_equal(a.disparity.values, b.disparity.values)
    np.testing.assert_array_equal(a.preliminary.values, b.preliminary.values)
    for name in ('labels', 'planes', 'is_fitted', 'inlier_ratio'):
        np.testing.assert_array_equal(getattr(a.segments, name), getattr(b.segments, name), name)
    assert a.lr_consistent_ratio == pytest.approx(b.lr_consistent_ratio, abs=0, nan_ok=True)


def assert_sound(result, shape, first, count):
    """Check types, shapes, the range and that what is valid is finite."""
    for disparity in (result.disparity, result.preliminary):
        values = disparity.values
        assert values.dtype == np.float32 and values.shape == shape
        assert not np.isinf(values).any()
        known = values[np.isfinite(values)]
        assert known.size == 0 or first <= known.min() <= known.max() < first + count
    segments = result.segments
    amount = len(segments.planes)
    assert segments.labels.dtype == np.int32 and segments.labels.shape == shape
    assert segments.planes.dtype == np.float64 and segments.planes.shape == (amount, 3)
    assert segments.is_fitted.shape == segments.inlier_ratio.shape == (amount,)
    assert 0 <= segments.labels.min() <= segments.labels.max() < amount
    assert np.isfinite(segments.planes[segments.is_fitted]).all()
    assert np.all((segments.inlier_ratio >= 0) & (segments.inlier_ratio <= 1))
    assert set(result.stage_ms) == STAGES
    assert all(ms >= 0 for ms in result.stage_ms.values())


def disparities_of(segments):
    """Evaluate the planes at every pixel; mark the pixels of fitted segments."""
    y, x = np.indices(segments.labels.shape)
    a, b, c = segments.planes[segments.labels].transpose(2, 0, 1)
    return a * x + b * y + c, segments.is_fitted[segments.labels]


def bad_ratio(values, truth, limit=1.0):
    return 1 - np.mean(np.abs(values - truth) <= limit)


@pytest.mark.parametrize('preset', PRESETS)
def test_the_same_input_gives_the_same_bits(scene, preset):
    first = refine(views(scene), preset)
    assert_same(refine(views(scene), preset, processing__threads=1), first)
    assert_same(refine(views(scene), preset, processing__threads=5), first)
    refiner = StereoRefiner(load_preset(preset, {'matching.num_disparities': RANGE}))
    refiner.process(*(np.ascontiguousarray(view[::-1]) for view in views(scene)))
    assert_same(refiner.process(*views(scene)), first)


def test_refiners_beside_each_other_do_not_meet(scene):
    expected = {preset: refine(views(scene), preset) for preset in PRESETS}
    with ThreadPoolExecutor(4) as pool:
        tasks = [(preset, pool.submit(refine, views(scene), preset, processing__threads=threads))
                 for preset in PRESETS for threads in (1, 2, 3) for _ in range(2)]
        for preset, task in tasks:
            assert_same(task.result(timeout=60), expected[preset])


@pytest.mark.parametrize('preset', PRESETS)
@pytest.mark.parametrize('seed', [0, 1, 2])
def test_refined_is_better_than_preliminary(preset, seed):
    scene = render_scene(seed=seed, height=120, width=160, num_disparities=RANGE)
    result = refine(views(scene), preset)
    assert_sound(result, (120, 160), 0, RANGE)
    before, after = (bad_ratio(disparity.values, scene.truth)
                     for disparity in (result.preliminary, result.disparity))
    assert after < 0.025
    assert after < before / 3
    assert result.disparity.valid_ratio == 1.0
    assert 0.7 < result.lr_consistent_ratio < 1.0


@pytest.mark.parametrize('preset, tolerance', [
    ('live', 0.25), ('accurate', 0.25), ('paper', 0.6)])
def test_known_planes_are_recovered(preset, tolerance):
    scene = render_scene(seed=1, height=240, width=320, num_disparities=48)
    segments = refine(views(scene), preset, matching__num_disparities=48).segments
    found, errors = set(), []
    for label in np.flatnonzero(segments.is_fitted):
        y, x = np.nonzero(segments.labels == label)
        surfaces = np.bincount(scene.labels[y, x])
        truth = int(surfaces.argmax())
        if len(x) >= 300 and surfaces[truth] >= 0.9 * len(x):
            a, b, c = segments.planes[label] - scene.planes[truth]
            errors.append(np.abs(a * x + b * y + c).mean())
            found.add(truth)
    assert len(errors) >= 20
    assert len(found) >= len(scene.planes) - 1
    assert np.median(errors) < tolerance / 2
    assert np.percentile(errors, 90) < tolerance


@pytest.mark.parametrize('preset', PRESETS)
@pytest.mark.parametrize('is_grey', [False, True])
def test_input_is_never_written_to(scene, preset, is_grey):
    left, right = (view[..., 1].copy() if is_grey else view.copy() for view in views(scene))
    expected = refine((left, right), preset)
    copies = left.copy(), right.copy()
    left.flags.writeable = right.flags.writeable = False
    assert_same(refine((left, right), preset), expected)
    np.testing.assert_array_equal(left, copies[0])
    np.testing.assert_array_equal(right, copies[1])
    external = scene.truth.copy()
    external.flags.writeable = False
    result = refine((left, right), preset, external)
    np.testing.assert_array_equal(external, scene.truth)
    assert not np.shares_memory(result.preliminary.values, external)
    assert not np.shares_memory(result.disparity.values, external)


@pytest.mark.parametrize('preset', PRESETS)
def test_images_need_not_be_contiguous(scene, preset):
    cuts = [view[10:110:2, 5:150] for view in views(scene)]
    assert not any(cut.flags.c_contiguous for cut in cuts)
    assert_same(refine(cuts, preset), refine([cut.copy() for cut in cuts], preset))
    flipped = [view[:, :, ::-1] for view in views(scene)]
    assert_same(refine(flipped, preset), refine([view.copy() for view in flipped], preset))


def noisy_truth(scene, dtype=np.float32):
    rng = np.random.default_rng(3)
    values = scene.truth + rng.normal(0, 0.1, scene.truth.shape)
    values[rng.random(values.shape) < 0.1] = np.nan
    values[40:60, 30:50] = np.nan
    return values.astype(dtype)


@pytest.mark.parametrize('preset', PRESETS)
@pytest.mark.parametrize('has_right', [True, False])
def test_an_external_map_is_refined_with_and_without_the_right_view(scene, preset, has_right):
    left, right = views(scene)
    external = noisy_truth(scene)
    result = refine((left, right if has_right else None), preset, external,
                    matching__method='external')
    assert_sound(result, (120, 160), 0, RANGE)
    np.testing.assert_array_equal(result.preliminary.values, external)
    assert bad_ratio(result.disparity.values, scene.truth) < 0.03
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


@pytest.mark.parametrize('preset', PRESETS)
@pytest.mark.parametrize('has_right', [True, False])
def test_a_map_without_a_valid_pixel_stays_one(scene, preset, has_right):
    left, right = views(scene)
    result = refine((left, right if has_right else None), preset,
                    np.full((120, 160), np.nan, np.float32))
    assert not result.disparity.valid.any()
    assert not result.segments.is_fitted.any()


@pytest.mark.parametrize('projection', ['full', 'guarded', 'off'])
def test_one_valid_pixel_is_no_reason_to_fail(scene, projection):
    external = np.full((120, 160), np.nan, np.float32)
    external[50, 70] = 9.5
    result = refine(views(scene), preliminary=external, planes__projection=projection)
    expected = np.full_like(external, 9.5) if projection == 'guarded' else external
    np.testing.assert_array_equal(result.disparity.values, expected)


def test_without_projection_and_filter_nothing_changes(scene):
    result = refine(views(scene), planes__projection='off', filter__method='none')
    np.testing.assert_array_equal(result.disparity.values, result.preliminary.values)
    assert np.isnan(result.segments.planes).all()
    assert not result.segments.is_fitted.any()


def test_full_projection_puts_every_pixel_of_a_fitted_segment_on_its_plane(scene):
    result = refine(views(scene), planes__projection='full', filter__method='none')
    expected, on_plane = disparities_of(result.segments)
    expected = np.clip(expected, 0, RANGE - 1).astype(np.float32)
    np.testing.assert_array_equal(result.disparity.values[on_plane], expected[on_plane])
    np.testing.assert_array_equal(
        result.disparity.values[~on_plane], result.preliminary.values[~on_plane])


@@ROWS@@def test_pairs_that_are_none_are_refused(scene):
    with pytest.raises(ValueError, match='needs the right image'):
        refine((scene.pair.left, None))
    with pytest.raises(ValueError, match='external'):
        refine(views(scene), matching__method='external')
    with pytest.raises(ValueError, match='differ in shape'):
        refine((scene.pair.left, scene.pair.right[:-1]))

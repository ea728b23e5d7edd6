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

"""The whole method: repeatable, read-only, better than what it started from, and sure of it."""

from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np
import pytest
from real_pairs import lowered
from refined_pairs import (
    assert_same, assert_sound, bad_ratio, GRIDS, noisy_truth, RANGE, refine, refiner, views)

from stereo_refine_ros.datasets.synthetic import render_scene
from stereo_refine_ros.matching import compute_match
from stereo_refine_ros.params import MATCHERS, PRESETS

OWN_MATCHERS = [method for method in MATCHERS if method != 'external']
SHAPE = (120, 160)


@pytest.fixture(scope='module')
def scene():
    return render_scene(seed=0, height=120, width=160, num_disparities=RANGE)


def disparities_of(segments):
    """Evaluate the planes at every pixel; mark the pixels of fitted segments."""
    y, x = np.indices(segments.labels.shape)
    a, b, c = segments.planes[segments.labels].transpose(2, 0, 1)
    return a * x + b * y + c, segments.is_fitted[segments.labels]


@pytest.mark.parametrize('pixels', GRIDS)
@pytest.mark.parametrize('preset', PRESETS)
def test_the_same_input_gives_the_same_bits(scene, preset, pixels):
    values = {'processing__refine_pixels': pixels, 'temporal__enabled': False}
    first = refine(views(scene), preset, **values)
    for threads in (1, 3):
        assert_same(refine(views(scene), preset, processing__threads=threads, **values), first)
    used = refiner(preset, **values)
    used.process(*(np.ascontiguousarray(view[::-1]) for view in views(scene)))
    used.process(scene.pair.left, lowered(scene.pair.right, 2))
    assert_same(used.process(*views(scene)), first)
    assert_same(used.process(*views(scene), threads=3), first)


@pytest.mark.parametrize('pixels', GRIDS)
@pytest.mark.parametrize('has_right', [True, False])
def test_maps_from_outside_give_the_same_bits_on_any_threads(scene, has_right, pixels):
    pair = scene.pair.left, scene.pair.right if has_right else None
    one = refiner(processing__refine_pixels=pixels)
    results = [one.process(*pair, noisy_truth(scene), threads) for threads in (1, 2, 3)]
    for result in results[1:]:
        assert_same(result, results[0])


def test_refiners_beside_each_other_do_not_meet(scene):
    expected = {preset: refine(views(scene), preset) for preset in PRESETS}
    with ThreadPoolExecutor(4) as pool:
        tasks = [(preset, pool.submit(refine, views(scene), preset, processing__threads=threads))
                 for preset in PRESETS for threads in (1, 2, 3) for _ in range(2)]
        for preset, task in tasks:
            assert_same(task.result(timeout=60), expected[preset])


def test_frames_of_one_refiner_do_not_meet(scene):
    shared = refiner(temporal__enabled=False)
    low = scene.pair.left, lowered(scene.pair.right, 2)
    pairs = [views(scene), low]
    expected = [refine(pair, temporal__enabled=False) for pair in pairs]
    with ThreadPoolExecutor(4) as pool:
        tasks = [pool.submit(shared.process, *pairs[i % 2], threads=1) for i in range(8)]
        for i, task in enumerate(tasks):
            assert_same(task.result(timeout=60), expected[i % 2])


@pytest.mark.parametrize('pixels', GRIDS)
@pytest.mark.parametrize('preset', PRESETS)
@pytest.mark.parametrize('seed', [0, 1, 2])
def test_refined_is_better_than_preliminary(preset, seed, pixels):
    scene = render_scene(seed=seed, height=120, width=160, num_disparities=RANGE)
    result = refine(views(scene), preset, processing__refine_pixels=pixels)
    assert_sound(result, SHAPE, 0, RANGE)
    before, after = (bad_ratio(disparity.values, scene.truth)
                     for disparity in (result.preliminary, result.disparity))
    assert after < (before if preset == 'paper' else before / 2)
    assert after < (0.06 if pixels == 0 else 0.05)
    assert result.disparity.valid_ratio == 1.0
    assert 0.7 < result.lr_consistent_ratio < 1.0


@pytest.mark.parametrize('method', OWN_MATCHERS)
def test_the_matchers_map_is_handed_on_untouched(scene, method):
    result = refine(views(scene), matching__method=method, rectification__correct=False)
    matching = refiner(matching__method=method).params.matching
    np.testing.assert_array_equal(
        result.preliminary.values, compute_match(scene.pair, matching).disparity.values)
    assert result.disparity.valid_ratio == 1.0
    assert not np.shares_memory(result.disparity.values, result.preliminary.values)


@pytest.mark.parametrize('pixels', GRIDS)
def test_what_is_sure_is_right_more_often(pixels):
    sure_wrong, doubtful_wrong = [], []
    for seed in range(4):
        scene = render_scene(seed=seed, height=120, width=160, num_disparities=RANGE)
        result = refine(views(scene), processing__refine_pixels=pixels)
        wrong = np.abs(result.disparity.values - scene.truth) > 1
        sure_wrong.append(wrong[result.confidence >= 0.9])
        doubtful_wrong.append(wrong[result.confidence < 0.6])
    sure_wrong, doubtful_wrong = map(np.concatenate, (sure_wrong, doubtful_wrong))
    assert sure_wrong.size > 0.5 * 4 * wrong.size
    assert sure_wrong.mean() < 0.06 and doubtful_wrong.mean() > 4 * sure_wrong.mean()


def test_a_row_off_is_put_right_and_told(scene):
    low = scene.pair.left, lowered(scene.pair.right, 2)
    put_right = refine(low)
    left_so = refine(low, rectification__correct=False)
    for result in (put_right, left_so):
        assert result.health.row_offset_px == pytest.approx(2, abs=0.15)
    wrong, wrong_left_so = (bad_ratio(result.disparity.values, scene.truth)
                            for result in (put_right, left_so))
    assert wrong < 0.06 and wrong < wrong_left_so


@pytest.mark.parametrize('preset, tolerance', [
    ('live', 0.25), ('accurate', 0.25), ('paper', 0.6)])
@pytest.mark.parametrize('pixels', GRIDS)
def test_known_planes_are_recovered(preset, tolerance, pixels):
    scene = render_scene(seed=1, height=240, width=320, num_disparities=48)
    segments = refine(views(scene), preset, matching__num_disparities=48,
                      processing__refine_pixels=pixels).segments
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


@pytest.mark.parametrize('pixels', GRIDS)
@pytest.mark.parametrize('preset', ['live', 'accurate'])
def test_grey_views_are_colour_views_of_equal_channels(scene, preset, pixels):
    grey = [cv2.cvtColor(view, cv2.COLOR_BGR2GRAY) for view in views(scene)]
    colour = [cv2.merge([view] * 3) for view in grey]
    # The weighted median rounds the sum of channels, not their number.
    values = {'processing__refine_pixels': pixels, 'filter__method': 'median'}
    assert_same(refine(colour, preset, **values), refine(grey, preset, **values))

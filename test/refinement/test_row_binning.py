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

"""Averaged rows, and what comes back from them."""

import numpy as np
import pytest

from stereo_refine_ros.params import load_preset, ProcessingParams
from stereo_refine_ros.pipeline import StereoRefiner
from stereo_refine_ros.refinement.row_binning import (
    bin_disparities, bin_rows, keep_agreeing, repeat_rows, restore_rows, rows_per_bin)
from stereo_refine_ros.types import PlaneSegmentation, StereoPair


def segmentation(labels, planes):
    count = len(planes)
    return PlaneSegmentation(labels.astype(np.int32), np.array(planes, float),
                             np.ones(count, bool), np.ones(count, np.float32))


def flat_scene(shape, rows):
    """Return binned and full image of one grey."""
    height, width = shape
    return tuple(np.full((h, width, 3), 90, np.uint8) for h in (-(-height // rows), height))


@pytest.mark.parametrize('shape, depth, expected', [
    ((480, 640), 64, 4), ((480, 640), 32, 3), ((375, 450), 60, 2),
    ((370, 463), 76, 2), ((288, 384), 16, 1), ((720, 1280), 128, 6),
    ((100, 5000), 512, 1), ((239, 5000), 512, 1), ((1, 1), 1, 1)])
def test_as_many_rows_are_averaged_as_the_limits_ask_for(shape, depth, expected):
    params = ProcessingParams(max_cells=9.5, min_rows=120)
    assert rows_per_bin(shape, depth, params) == expected


def test_images_are_averaged_and_the_last_row_repeats():
    left = np.array([[10, 20], [30, 60], [50, 70]], np.uint8)
    binned = bin_rows(StereoPair(left, 2 * left), 2)
    assert binned.left.tolist() == [[20, 40], [50, 70]]
    assert binned.right.tolist() == [[40, 80], [100, 140]]
    alone = bin_rows(StereoPair(np.repeat(left[..., None], 3, 2), None), 3)
    assert alone.right is None
    assert alone.left.tolist() == [[[30] * 3, [50] * 3]]


def test_one_row_per_bin_changes_nothing():
    rng = np.random.default_rng(0)
    pair = StereoPair(*rng.integers(0, 256, (2, 5, 6), dtype=np.uint8))
    values = rng.random((5, 6), dtype=np.float32)
    segments = segmentation(np.zeros((5, 6)), [[0, 0, 1]])
    assert bin_rows(pair, 1) is pair
    assert bin_disparities(values, 1) is values
    assert repeat_rows(values, 5, 1) is values
    assert restore_rows(values, segments, pair.left, pair.left, 1) == (values, segments)


def test_disparities_are_picked_and_not_averaged():
    nan = np.nan
    values = np.array([[1, nan, nan], [2, nan, 7], [nan, 5, nan], [3, 6, 8]], np.float32)
    binned = bin_disparities(values, 2)
    np.testing.assert_array_equal(binned, np.array([[2, nan, 7], [3, 6, 8]], np.float32))
    np.testing.assert_array_equal(
        bin_disparities(values, 3), np.array([[2, 5, 7], [3, 6, 8]], np.float32))
    assert np.isnan(values[0, 1])


def test_an_external_map_keeps_its_rows_where_the_restored_map_agrees():
    restored = np.array([[5.0, 5.0, 5.0, np.nan, 7.0]], np.float32)
    preliminary = np.array([[5.9, 6.5, np.nan, 3.0, 7.0]], np.float32)
    np.testing.assert_array_equal(
        keep_agreeing(restored, preliminary), np.array([[5.9, 5, 5, np.nan, 7]], np.float32))


def test_repeated_rows_end_with_the_image():
    values = np.array([[1, 2], [3, 4]], np.float32)
    assert repeat_rows(values, 3, 2).tolist() == [[1, 2], [1, 2], [3, 4]]


@pytest.mark.parametrize('rows', [2, 3, 4])
def test_a_plane_comes_back_exactly_and_so_do_its_numbers(rows):
    shape = (4 * rows, 9)
    binned, image = flat_scene(shape, rows)
    v, x = np.indices(binned.shape[:2])
    values = (0.2 * x - 0.6 * v + 7).astype(np.float32)
    restored, segments = restore_rows(
        values, segmentation(np.zeros(values.shape), [[0.2, -0.6, 7.0]]), binned, image, rows)
    y, x = np.indices(shape)
    a, b, c = segments.planes[0]
    expected = a * x + b * y + c
    inner = slice((rows - 1) // 2 + 1, shape[0] - rows // 2 - 1)
    np.testing.assert_allclose(restored[inner], expected[inner], atol=1e-5)
    # Averaged row v stands for the middle of its rows.
    middle = a * 3 + b * (2 * rows + (rows - 1) / 2) + c
    assert middle == pytest.approx(0.2 * 3 - 0.6 * 2 + 7)
    assert segments.labels.shape == restored.shape == shape
    assert restored.dtype == np.float32 and segments.labels.dtype == np.int32


@pytest.mark.parametrize('rows', [2, 3])
def test_an_edge_comes_back_where_the_colours_have_it(rows):
    height, width = 8 * rows, 24
    y, x = np.indices((height, width))
    is_near = x + y // 2 > 14
    image = np.where(is_near, 200, 40).astype(np.uint8)
    binned = bin_rows(StereoPair(image, None), rows).left
    labels = (binned > 120).astype(np.int32)
    values = np.where(labels, 20, 5).astype(np.float32)
    segments = segmentation(labels, [[0, 0, 5], [0, 0, 20]])
    restored, back = restore_rows(values, segments, binned, image, rows)
    assert np.array_equal(restored == 20, is_near)
    assert np.array_equal(restored == 5, ~is_near)
    assert np.array_equal(back.labels == 1, is_near)


@pytest.mark.parametrize('rows', [2, 3, 5])
@pytest.mark.parametrize('shape', [(11, 9, 3), (6, 7), (1, 5), (13, 1, 3)])
def test_every_value_and_label_comes_from_next_door(shape, rows):
    rng = np.random.default_rng(rows)
    image = rng.integers(0, 256, shape, dtype=np.uint8)
    binned = bin_rows(StereoPair(image, None), rows).left
    values = rng.choice([4, 4.5, 5, 9, np.nan], binned.shape[:2]).astype(np.float32)
    labels = np.arange(values.size).reshape(values.shape)
    for array in (values, labels, image, binned):
        array.flags.writeable = False
    restored, back = restore_rows(
        values, segmentation(labels, np.zeros((values.size, 3))), binned, image, rows)
    for y, x in np.ndindex(shape[:2]):
        upper = max(int(np.floor((y + 0.5) / rows - 0.5)), 0)
        near = (slice(upper, upper + 2), slice(max(x - 1, 0), x + 2))
        assert back.labels[y, x] in labels[near]
        if np.isfinite(restored[y, x]):
            assert np.nanmin(values[near]) <= restored[y, x] <= np.nanmax(values[near])
        else:
            assert np.isnan(values[near]).any()


@pytest.mark.compiled
@pytest.mark.parametrize('threads', [2, 3, 40])
def test_bands_do_not_change_what_comes_back(threads):
    rng = np.random.default_rng(1)
    image = rng.integers(0, 256, (24, 10, 3), dtype=np.uint8)
    binned = bin_rows(StereoPair(image, None), 2).left
    values = rng.uniform(3, 6, (12, 10)).astype(np.float32)
    segments = segmentation(rng.integers(0, 4, (12, 10)), np.zeros((4, 3)))
    once, segments_once = restore_rows(values, segments, binned, image, 2)
    again, segments_again = restore_rows(values, segments, binned, image, 2, threads)
    np.testing.assert_array_equal(again, once)
    np.testing.assert_array_equal(segments_again.labels, segments_once.labels)


@pytest.mark.parametrize('projection', ['full', 'guarded', 'off'])
def test_an_external_map_without_planes_is_the_same_on_averaged_rows(projection):
    views = np.random.default_rng(0).integers(0, 256, (2, 40, 60, 3), dtype=np.uint8)
    external = np.full((40, 60), np.nan, np.float32)
    external[20, 30] = 9.5
    answers = []
    for cells in (1000.0, 0.01):
        refiner = StereoRefiner(load_preset('live', {
            'matching.num_disparities': 16, 'planes.projection': projection,
            'processing.max_cells': cells, 'processing.min_rows': 10, 'processing.threads': 1}))
        # Unsigned scalars may wrap round where the kernels run as plain Python.
        with np.errstate(over='ignore'):
            answers.append(refiner.process(*views, external).disparity.values)
    np.testing.assert_array_equal(answers[0], 9.5 if projection == 'guarded' else external)
    np.testing.assert_array_equal(answers[1], answers[0])

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

"""Merging against refits of the united points, adoption against dictionaries."""

import numpy as np
import plane_reference
import pytest

from stereo_refine_ros.graph.segment_graph import Borders, find_borders, group_pixels
from stereo_refine_ros.graph.segmentation import segment_image
from stereo_refine_ros.params import PlaneParams, SegmentationParams
from stereo_refine_ros.refinement.plane_sharing import adopt_planes, merge_coplanar, SharedPlanes
from stereo_refine_ros.refinement.planes import fit_planes, PlaneFits
from stereo_refine_ros.refinement.tuning import ADOPTION_PASSES, MERGE_RISE, MIN_DATA

PARAMS = PlaneParams()


@pytest.fixture(autouse=True)
def wrapping_allowed():
    """Let unsigned scalars wrap round where the kernels run as plain Python."""
    with np.errstate(over='ignore'):
        yield


def patchwork(seed):
    """Return image, labels, count and disparities: few planes under many segments."""
    rng = np.random.default_rng(seed)
    blocks = rng.integers(0, 256, (5, 6, 3), dtype=np.uint8)
    image = blocks.repeat(8, axis=0).repeat(8, axis=1)
    labels, count = segment_image(image, SegmentationParams(1.0, 0.0, 1))
    planes = np.array([[0.2, 0.0, 5.0], [0.0, 0.3, 14.0], [-0.1, 0.1, 9.0]])
    chosen = planes[rng.integers(0, 3, count)]
    y, x = np.indices(labels.shape)
    data = (chosen[labels] * np.dstack([x, y, np.ones_like(x)])).sum(2)
    data += rng.normal(0, 0.15, data.shape)
    data[labels == 3] = rng.uniform(0, 60, (labels == 3).sum())
    data[(labels == 7) & (rng.random(data.shape) < 0.7)] = np.nan
    data[labels == 11] = np.nan
    return image, labels, count, data.astype(np.float32)


def make_borders(pairs, distance, length=1.0):
    count = len(pairs)
    distance = np.asarray(distance, np.float32)
    return Borders(np.array(pairs, np.int32).reshape(-1, 2), np.full(count, length, np.float32),
                   distance, np.zeros((count, 2), np.float32))


def make_fits(data_count, inlier_ratio):
    count = len(data_count)
    planes = np.arange(5.0 * count).reshape(count, 5)
    return PlaneFits(planes, np.array(inlier_ratio, np.float32), np.array(data_count, np.int32),
                     np.zeros((count, 10)))


def unshared(fits):
    return SharedPlanes(fits.planes, np.arange(len(fits.planes), dtype=np.int32))


@pytest.mark.parametrize('seed', range(5))
def test_merging_by_moments_is_a_refit_of_the_united_points(seed):
    image, labels, count, data = patchwork(seed)
    fits = fit_planes(group_pixels(labels, count), data, PARAMS)
    borders = find_borders(labels, count, image)
    shared = merge_coplanar(fits, borders, PARAMS)
    merged = shared.by_segment()
    points = []
    for label in range(count):
        y, x = np.nonzero((labels == label) & np.isfinite(data))
        rows = np.column_stack([x, y, data[y, x]]).astype(float)
        near = np.abs(plane_reference.residuals(rows, fits.planes[label, :3]))
        points.append(rows[near <= PARAMS.inlier_threshold])
    trusted = [ratio >= PARAMS.min_inlier_ratio and len(rows) >= MIN_DATA
               for ratio, rows in zip(fits.inlier_ratio, points, strict=True)]
    assert not trusted[3] and not trusted[7] and not trusted[11]
    order = np.argsort(borders.color_distance, kind='stable')
    expected = plane_reference.merge(
        points, fits.planes[:, :3], trusted, borders.pairs[order].tolist(),
        MERGE_RISE)
    np.testing.assert_allclose(merged[:, :3], expected, rtol=1e-6, atol=1e-6)
    np.testing.assert_array_equal(shared.index < 0, np.isnan(fits.planes[:, 0]))
    for number, plane in enumerate(shared.coefficients):
        parts = fits.planes[shared.index == number, 3:]
        assert plane[3:].tolist() == [parts[:, 0].min(), parts[:, 1].max()]
    assert len(np.unique(shared.coefficients, axis=0)) == len(shared.coefficients)
    assert len(shared.coefficients) < np.count_nonzero(shared.index >= 0)


def test_merging_leaves_the_fits_alone():
    image, labels, count, data = patchwork(0)
    fits = fit_planes(group_pixels(labels, count), data, PARAMS)
    planes, moments = fits.planes.copy(), fits.moments.copy()
    merge_coplanar(fits, find_borders(labels, count, image), PARAMS)
    np.testing.assert_array_equal(fits.planes, planes)
    np.testing.assert_array_equal(fits.moments, moments)


def test_neighbours_of_different_depth_stay_apart():
    labels = np.zeros((8, 20), np.int32)
    labels[:, 10:] = 1
    data = np.where(labels == 0, 5.0, 8.0).astype(np.float32)
    fits = fit_planes(group_pixels(labels, 2), data, PARAMS)
    merged = merge_coplanar(fits, make_borders([(0, 1)], [0.0]), PARAMS)
    assert merged.index.tolist() == [0, 1]
    np.testing.assert_allclose(merged.coefficients[:, :3], [[0, 0, 5], [0, 0, 8]], atol=1e-9)


@pytest.mark.parametrize('seed', range(5))
def test_planes_are_adopted_from_the_least_unlike_neighbour(seed):
    rng = np.random.default_rng(seed)
    count = 14
    every = [(a, b) for a in range(count) for b in range(a + 1, count)]
    pairs = [every[i] for i in rng.permutation(len(every))[:24]]
    borders = make_borders(pairs, rng.uniform(0, 90, 24))
    borders.length[:] = rng.integers(1, 40, 24)
    own = rng.random(count) < 0.3
    fits = make_fits(np.where(own, 50, 10), np.full(count, 0.9))
    adopted, found_own = adopt_planes(unshared(fits), fits, borders, PARAMS)
    unlikeness = borders.color_distance - 2 * np.log(borders.length)
    np.testing.assert_array_equal(found_own, own)
    np.testing.assert_array_equal(adopted.by_segment(), plane_reference.adopt(
        fits.planes, own, borders.pairs, unlikeness, ADOPTION_PASSES))


def test_adoption_goes_on_from_neighbour_to_neighbour_a_limited_way():
    count = 30
    fits = make_fits([50] + [0] * (count - 1), [1.0] + [0.0] * (count - 1))
    borders = make_borders([(i, i + 1) for i in range(count - 1)], np.zeros(count - 1))
    adopted, own = adopt_planes(unshared(fits), fits, borders, PARAMS)
    reach = ADOPTION_PASSES
    assert own.tolist() == [True] + [False] * (count - 1)
    assert np.all(adopted.index[:reach + 1] == 0)
    assert np.all(adopted.index[reach + 1:] == -1)


def test_few_data_or_few_inliers_are_no_evidence():
    fits = make_fits([MIN_DATA, MIN_DATA - 1, 90, 90], [1.0, 1.0, 0.4, 0.6])
    adopted, own = adopt_planes(unshared(fits), fits, make_borders([], []), PARAMS)
    assert own.tolist() == [True, False, False, True]
    assert adopted.index.tolist() == [0, -1, -1, 3]
    planes = adopted.by_segment()
    assert np.isnan(planes[1:3]).all()
    np.testing.assert_array_equal(planes[[0, 3]], fits.planes[[0, 3]])


def test_a_segment_of_inliers_only_passes_the_strictest_ratio():
    fits = make_fits([90, 90], [1.0, 0.99])
    params = PlaneParams(min_inlier_ratio=1.0)
    own = adopt_planes(unshared(fits), fits, make_borders([], []), params)
    assert own[1].tolist() == [True, False]

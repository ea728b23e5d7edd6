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

"""RANSAC planes: known planes come back, with outliers too, whatever the threads."""

import numpy as np
import plane_reference
import pytest

from stereo_refine_ros.graph.segment_graph import group_pixels
from stereo_refine_ros.params import PlaneParams
from stereo_refine_ros.refinement.planes import fit_planes

THRESHOLD = PlaneParams().inlier_threshold


@pytest.fixture(autouse=True)
def wrapping_allowed():
    """Let unsigned scalars wrap round where the kernels run as plain Python."""
    with np.errstate(over='ignore'):
        yield


def strips(height, widths):
    """Return labels of upright strips of the given widths."""
    return np.tile(np.repeat(np.arange(len(widths), dtype=np.int32), widths), (height, 1))


def render(labels, planes):
    y, x = np.indices(labels.shape)
    a, b, c = np.asarray(planes)[labels, :3].transpose(2, 0, 1)
    return (a * x + b * y + c).astype(np.float32)


def points_of(labels, data, label):
    y, x = np.nonzero((labels == label) & np.isfinite(data))
    return np.column_stack([x, y, data[y, x]]).astype(float)


def fit(labels, data, threads=1, **values):
    count = int(labels.max()) + 1
    return fit_planes(group_pixels(labels, count), data, PlaneParams(**values), threads)


def noisy_strips(seed, noise=0.3, outliers=0.3, holes=0.1):
    rng = np.random.default_rng(seed)
    labels = strips(18, [14, 20, 9])
    truth = render(labels, [[0.1, -0.2, 12.0], [-0.3, 0.25, 20.0], [0.0, 0.0, 7.0]])
    data = truth + rng.normal(0, noise, truth.shape).astype(np.float32)
    data[rng.random(data.shape) < outliers] += rng.uniform(5, 30)
    data[rng.random(data.shape) < holes] = np.nan
    return labels, truth, data


def test_fronto_parallel_planes_are_recovered_exactly():
    labels = strips(12, [8, 5, 11])
    planes = [[0, 0, 5.5], [0, 0, 31.25], [0, 0, -3.0]]
    fits = fit(labels, render(labels, planes))
    np.testing.assert_allclose(fits.planes[:, :3], planes, atol=1e-12)
    assert fits.inlier_ratio.tolist() == [1.0, 1.0, 1.0]
    assert fits.data_count.tolist() == [96, 60, 132]


@pytest.mark.parametrize('slope', [(0.3, 0.0), (0.0, -0.6), (-0.25, 0.4), (0.05, 1.2)])
def test_slanted_planes_without_noise_are_recovered_up_to_the_ridge(slope):
    labels = strips(20, [16, 21])
    truth = render(labels, [[*slope, 15.0], [0.0, 0.1, 4.0]])
    fits = fit(labels, truth)
    assert fits.inlier_ratio.tolist() == [1.0, 1.0]
    for label in range(2):
        points = points_of(labels, truth, label)
        np.testing.assert_allclose(
            fits.planes[label, :3], plane_reference.ridge_plane(points), rtol=1e-6, atol=1e-6)
    # The ridge takes 30 / (n var x) of a slope, here less than half a per cent.
    np.testing.assert_allclose(fits.planes[0, :2], slope, atol=0.01)
    assert np.abs(render(labels, fits.planes) - truth).max() < 0.06


@pytest.mark.parametrize('seed', range(4))
def test_planes_are_recovered_with_a_third_of_outliers(seed):
    labels, truth, data = noisy_strips(seed, noise=0.05)
    fits = fit(labels, data)
    assert np.abs(render(labels, fits.planes) - truth).max() < 0.15
    assert np.all(np.abs(fits.inlier_ratio - 0.7) < 0.1)


@pytest.mark.parametrize('seed', range(4))
def test_the_plane_is_the_least_squares_plane_of_its_inliers(seed):
    labels, _, data = noisy_strips(seed, noise=0.1)
    fits = fit(labels, data)
    for label in range(3):
        points = points_of(labels, data, label)
        inliers = points[
            np.abs(plane_reference.residuals(points, fits.planes[label, :3])) <= THRESHOLD]
        assert fits.data_count[label] == len(points)
        assert fits.inlier_ratio[label] == np.float32(len(inliers) / len(points))
        np.testing.assert_allclose(
            fits.planes[label, :3], plane_reference.ridge_plane(inliers), rtol=1e-6, atol=1e-6)
        x, y, d = inliers.T
        assert fits.planes[label, 3:].tolist() == [d.min(), d.max()]
        sums = [np.ones_like(x), x, y, d, x * x, x * y, y * y, x * d, y * d, d * d]
        np.testing.assert_allclose(fits.moments[label], np.sum(sums, axis=1), rtol=1e-9)


@pytest.mark.compiled
@pytest.mark.parametrize('threads', [2, 3, 16])
def test_threads_do_not_change_a_bit(threads):
    labels, _, data = noisy_strips(1)
    labels = (labels * 6 + np.indices(labels.shape)[0] // 3).astype(np.int32)
    once, again = fit(labels, data), fit(labels, data, threads)
    for name in ('planes', 'inlier_ratio', 'data_count', 'moments'):
        np.testing.assert_array_equal(getattr(again, name), getattr(once, name))


def test_the_seed_decides_between_equally_good_planes():
    labels = np.zeros((10, 20), np.int32)
    data = np.full(labels.shape, 4.0, np.float32)
    data[::2] = 24.0
    offsets = {fit(labels, data, seed=seed).planes[0, 2] for seed in range(12)}
    assert offsets == {4.0, 24.0}
    assert len({fit(labels, data, seed=5).planes[0, 2] for _ in range(3)}) == 1


def test_a_segment_of_less_than_three_data_has_no_plane():
    labels = strips(3, [2, 4])
    data = np.full(labels.shape, 5.0, np.float32)
    data[:, :2] = np.nan
    data[0, :2] = 7.0
    fits = fit(labels, data)
    assert np.isnan(fits.planes[0]).all()
    assert fits.planes[1, :3].tolist() == [0.0, 0.0, 5.0]
    assert fits.inlier_ratio.tolist() == [0.0, 1.0]
    assert fits.data_count.tolist() == [2, 12]
    assert not fits.moments[0].any()


def test_a_map_of_holes_gives_no_plane():
    fits = fit(strips(4, [3, 3]), np.full((4, 6), np.nan, np.float32))
    assert np.isnan(fits.planes).all()
    assert not fits.data_count.any() and not fits.inlier_ratio.any()


@pytest.mark.parametrize('slope, limit', [((3.0, 0.0), 0), ((0.0, -4.0), 1)])
def test_slopes_are_limited(slope, limit):
    labels = np.zeros((25, 25), np.int32)
    fits = fit(labels, render(labels, [[*slope, 50.0]]))
    assert np.all(np.abs(fits.planes[0, :2]) <= plane_reference.MAX_SLOPES)
    assert fits.inlier_ratio[0] < 0.5


@pytest.mark.parametrize('shape', [(1, 40), (40, 1)])
def test_a_line_of_pixels_gets_a_plane_through_it(shape):
    labels = np.zeros(shape, np.int32)
    data = np.linspace(5, 13, 40, dtype=np.float32).reshape(shape)
    fits = fit(labels, data, inlier_threshold=3.0)
    assert fits.inlier_ratio[0] == 1.0
    assert np.abs(render(labels, fits.planes) - data).max() < 0.1


@pytest.mark.parametrize('slope', [(0.3, -0.1), (0.6, 0.0), (0.5, 0.5)])
@pytest.mark.parametrize('shape', [(200, 24), (400, 12), (24, 200), (70, 70)])
def test_a_rectangle_is_not_judged_by_one_of_its_columns(shape, slope):
    rng = np.random.default_rng(0)
    labels = np.zeros(shape, np.int32)
    truth = render(labels, [[*slope, 40.0]])
    data = (truth + rng.normal(0, 0.3, shape)).astype(np.float32)
    data[rng.random(shape) < 0.3] = 55.0
    fits = fit(labels, data, iterations=60)
    assert np.abs(render(labels, fits.planes) - truth).max() < 0.2
    assert fits.inlier_ratio[0] == pytest.approx(0.7, abs=0.05)


def test_one_iteration_is_enough_for_a_flat_segment():
    labels = np.zeros((4, 5), np.int32)
    fits = fit(labels, np.full(labels.shape, 9.0, np.float32), iterations=1)
    assert fits.planes[:, :3].tolist() == [[0.0, 0.0, 9.0]]

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

"""The parts of the plane fit: random numbers, the sample, segments with hardly any data."""

import numpy as np
import pytest

from stereo_refine_ros.graph.segment_graph import group_pixels
from stereo_refine_ros.params import PlaneParams
from stereo_refine_ros.refinement.planes import (
    _draw, _next_random, _points_of, _sample, fit_planes)


@pytest.fixture(autouse=True)
def wrapping_allowed():
    """Let unsigned scalars wrap round where the kernels run as plain Python."""
    with np.errstate(over='ignore'):
        yield


def test_random_numbers_are_those_of_splitmix64():
    """Vigna's reference implementation, seed 1234567."""
    state, found = np.uint64(1234567), []
    for _ in range(5):
        state, bits = _next_random(np.uint64(state))
        found.append(int(bits))
    assert found == [6457827717110365317, 3203168211198807973, 9817491932198370423,
                     4593380528125082431, 16408922859458223821]


def test_draws_cover_all_indices_evenly():
    state, counts = np.uint64(3), np.zeros(7, int)
    for _ in range(700):
        state, index = _draw(np.uint64(state), 7)
        counts[index] += 1
    assert counts.min() > 60 and counts.max() < 140


def test_a_sample_takes_one_point_of_every_few():
    for total in (1, 2, 199, 200, 201, 399, 400, 401, 1003, 1999, 2001):
        points = np.tile(np.arange(total, dtype=np.float32), (3, 1))
        xs, ys, ds = _sample(points)
        step = -(-total // 200)
        first = np.arange(xs.size) * step
        assert xs.size == -(-total // step)
        assert (xs >= first).all() and (xs < np.minimum(first + step, total)).all(), total
        np.testing.assert_array_equal(xs, ys)
        np.testing.assert_array_equal(xs, ds)
        assert xs.dtype == np.float32
        # Spread evenly over the step, as over the columns of a strip of that width.
        assert len(set((xs - first).astype(int))) == step


def test_points_are_the_pixels_with_data_wherever_their_rows_begin():
    data = np.arange(24, dtype=np.float32).reshape(4, 6)
    data[1, 1] = np.nan
    members = np.array([5, 6, 7, 8, 21, 22], np.int32)  # one pixel of the first row, none of row 2
    points = _points_of(members, data)
    assert points.dtype == np.float32
    np.testing.assert_array_equal(points, [[5, 0, 2, 3, 4], [0, 1, 1, 3, 3], [5, 6, 8, 21, 22]])


def test_three_data_are_a_plane_and_two_are_none():
    labels = np.repeat(np.arange(4, dtype=np.int32), 4)[None].repeat(3, axis=0)
    data = np.full(labels.shape, np.nan, np.float32)
    data[0, 4:6] = data[1, 4] = 5.0
    data[2, 8:10] = 6.0
    data[:, 12:] = 9.0
    fits = fit_planes(group_pixels(labels, 4), data, PlaneParams())
    np.testing.assert_array_equal(fits.data_count, [0, 3, 2, 12])
    np.testing.assert_array_equal(np.isnan(fits.planes[:, 0]), [True, False, True, False])
    np.testing.assert_allclose(fits.planes[1, :3], [0, 0, 5], atol=1e-6)
    np.testing.assert_allclose(fits.planes[3, :3], [0, 0, 9], atol=1e-6)
    np.testing.assert_array_equal(fits.inlier_ratio, np.float32([0, 1, 0, 1]))
    np.testing.assert_array_equal(fits.moments[:, 0], [0, 3, 0, 12])

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

"""The candidates of every pixel, and the planes that some of them come from."""

import numpy as np

from stereo_refine_ros.refinement.candidates import propose
from stereo_refine_ros.refinement.likelihood import Evidence, PlaneMap
from stereo_refine_ros.refinement.projection import fill_along_planes, plane_disparities

N = np.nan


def row(*values):
    return np.float32([values])


def planes_of(values, behind, before):
    one = np.ones_like(values)
    return PlaneMap(values, one, behind, before, one, one)


def evidence_of(fine, coarse, has_right=True):
    nothing = np.full_like(fine, N)
    return Evidence(np.zeros(fine.shape, np.uint8), 1, fine, coarse, np.zeros_like(fine), nothing,
                    has_right)


def test_the_first_is_what_was_given_and_the_others_what_speaks():
    given = row(4, N, N, 7)
    planes = planes_of(row(4.5, 5, N, 7.5), row(4, 4.25, 3.5, 7), row(4, 6.75, N, 7))
    evidence = evidence_of(row(9, N, 9, N), row(N, 8, N, 8))
    maps = propose(given, planes, evidence)
    assert maps.dtype == np.float32
    np.testing.assert_array_equal(maps[:, 0], np.float32([
        [4, 4, 4, 7],  # holes take the background
        [4.5, 5, 4, 7.5],
        [4, 4.25, 3.5, 7],
        [4, 6.75, 4, 7],
        [9, 4, 9, 7],
        [4, 8, 4, 8]]))
    np.testing.assert_array_equal(given, row(4, N, N, 7))


def test_without_a_right_view_there_are_no_matches_to_propose():
    given = row(4, N)
    planes = planes_of(row(4.5, 5), row(N, N), row(N, N))
    maps = propose(given, planes, evidence_of(given, row(N, N), has_right=False))
    np.testing.assert_array_equal(maps[:, 0], np.float32([[4, 4], [4.5, 5], [4, 4], [4, 4]]))


def test_where_nothing_was_given_nothing_is_proposed_first():
    nothing = row(N, N)
    maps = propose(nothing, planes_of(nothing, nothing, nothing), evidence_of(row(3, N), nothing))
    assert np.isnan(maps[0]).all()


# a, b, c, and the disparities of the inliers, beyond which it is believed a little.
PLANES = np.array([[0.5, 0.0, 4.0, 0.0, 50.0], [0.0, 1.0, 20.0, 0.0, 50.0],
                   [N, N, N, N, N]])


def test_planes_are_evaluated_at_the_pixels_of_their_segments():
    labels = np.int32([[0, 0, 1, 2], [0, 1, 1, 2]])
    found = plane_disparities(labels, PLANES, 0, 100)
    assert found.dtype == np.float32
    np.testing.assert_array_equal(found, np.float32([[4, 4.5, 20, N], [4, 21, 21, N]]))
    np.testing.assert_array_equal(
        plane_disparities(labels, PLANES, 4.25, 20.5),
        np.float32([[4.25, 4.5, 20, N], [4.25, 20.5, 20.5, N]]))


def test_planes_end_soon_beyond_what_they_rest_on():
    planes = np.array([[1.0, 0.0, 0.0, 10.0, 12.0]])
    found = plane_disparities(np.zeros((1, 40), np.int32), planes, -50, 100)[0]
    np.testing.assert_array_equal(found[10:13], [10, 11, 12])
    assert 0 < found[0] < 10 and 12 < found[-1] < 39
    assert np.all(np.diff(found) >= 0)


def test_holes_go_on_in_the_planes_beside_them():
    labels = np.int32([[0, 0, 0, 0, 1, 1, 1]])
    values = row(N, 4.4, N, N, N, 20.3, N)
    behind, before = fill_along_planes(values, labels, PLANES, 0, 100)
    np.testing.assert_array_equal(behind, row(4, 4.4, 5, 5.5, 6, 20.3, 20))
    np.testing.assert_array_equal(before, row(4, 4.4, 20, 20, 20, 20.3, 20))
    assert behind.dtype == before.dtype == np.float32


def test_beside_a_pixel_without_a_plane_its_own_disparity_goes_on():
    labels = np.int32([[0, 0, 2, 2]])
    behind, before = fill_along_planes(row(4.4, N, N, 9.5), labels, PLANES, 0, 100)
    np.testing.assert_array_equal(behind, row(4.4, 4.5, 5, 9.5))
    np.testing.assert_array_equal(before, row(4.4, 9.5, 9.5, 9.5))


def test_rows_without_a_valid_pixel_stay_empty_and_planes_keep_to_the_range():
    labels = np.zeros((2, 3), np.int32)
    values = np.float32([[N, N, N], [4.4, N, N]])
    behind, before = fill_along_planes(values, labels, PLANES, 0, 4.75)
    np.testing.assert_array_equal(behind, np.float32([[N, N, N], [4.4, 4.5, 4.75]]))
    np.testing.assert_array_equal(before, behind)
    assert np.isnan(values[0]).all() and np.isnan(values[1, 1:]).all()

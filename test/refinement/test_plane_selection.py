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

"""The choice among planes against every energy written out."""

import numpy as np
import plane_reference
import pytest

from stereo_refine_ros.graph.segment_graph import find_borders, group_pixels
from stereo_refine_ros.matching.scanline import gather_evidence
from stereo_refine_ros.params import MatchingParams
from stereo_refine_ros.refinement.plane_selection import select_planes
from stereo_refine_ros.refinement.plane_sharing import SharedPlanes
from stereo_refine_ros.types import StereoPair


@pytest.fixture(autouse=True)
def wrapping_allowed():
    """Let unsigned scalars wrap round where the kernels run as plain Python."""
    with np.errstate(over='ignore'):
        yield


def select(planes, *args):
    """Select among planes that are believed everywhere."""
    found = np.isfinite(planes[:, 0])
    bounds = np.tile([-1000.0, 1000.0], (found.sum(), 1))
    coefficients, index = np.unique(planes[found], axis=0, return_inverse=True)
    numbers = np.full(len(planes), -1, np.int32)
    numbers[found] = index.reshape(-1)
    shared = SharedPlanes(np.hstack([coefficients, bounds[:len(coefficients)]]), numbers)
    return select_planes(shared, *args).by_segment()[:, :3]


def problem(seed, min_disparity=0):
    """Return labels, borders, evidence and matched pixels of 4 x 5 blocks of 6 x 6 pixels."""
    rng = np.random.default_rng(seed)
    labels = np.arange(20, dtype=np.int32).reshape(4, 5).repeat(6, axis=0).repeat(6, axis=1)
    views = rng.integers(60, 120, (2, *labels.shape, 3), dtype=np.uint8)
    views[1, :, :-3] = views[0, :, 3:]
    evidence = gather_evidence(
        StereoPair(*views), MatchingParams('scanline', min_disparity, 9))[0]
    borders = find_borders(labels, 20, views[0])
    return labels, borders, evidence, rng.random(labels.shape) < 0.5


@pytest.mark.parametrize('seed, min_disparity', [(0, 0), (1, 0), (2, -2), (3, 1), (4, 4)])
def test_selection_is_that_of_the_slow_version(seed, min_disparity):
    labels, borders, evidence, matched = problem(seed, min_disparity)
    rng = np.random.default_rng(seed)
    planes = np.column_stack([rng.normal(0, 0.02, (20, 2)), rng.uniform(-8, 12, 20)])
    planes[rng.permutation(20)[:8]] = [0.0, 0.0, 3.0]
    planes[rng.permutation(20)[:4]] = np.nan
    chosen = select(planes, group_pixels(labels, 20), borders, evidence, matched)
    expected = plane_reference.select(
        planes, labels, borders.pairs, borders.length, borders.color_distance, borders.middle,
        evidence, matched)
    np.testing.assert_array_equal(chosen, expected)
    assert not np.array_equal(chosen, planes, equal_nan=True)


def test_a_wrong_plane_gives_way_to_the_right_one_of_the_neighbours():
    labels, borders, evidence, matched = problem(0)
    planes = np.tile([0.0, 0.0, 3.0], (20, 1))
    planes[7], planes[12] = [0.0, 0.0, 6.0], np.nan
    before = planes.copy()
    chosen = select(planes, group_pixels(labels, 20), borders, evidence, matched)
    assert np.all(chosen == [0.0, 0.0, 3.0])
    np.testing.assert_array_equal(planes, before)


def test_without_any_plane_there_is_none_to_choose():
    labels, borders, evidence, matched = problem(0)
    chosen = select(
        np.full((20, 3), np.nan), group_pixels(labels, 20), borders, evidence, matched)
    assert np.isnan(chosen).all()


def test_one_segment_keeps_its_plane():
    _, _, evidence, matched = problem(0)
    labels = np.zeros(matched.shape, np.int32)
    borders = find_borders(labels, 1, np.zeros(labels.shape, np.uint8))
    plane = np.array([[0.1, 0.0, 2.0]])
    chosen = select(plane, group_pixels(labels, 1), borders, evidence, matched)
    np.testing.assert_array_equal(chosen, plane)

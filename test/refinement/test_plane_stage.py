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

"""The plane stage: full and guarded projection on maps whose truth is known."""

import dataclasses

import numpy as np
import plane_reference
import pytest

from stereo_refine_ros.graph.pixel_graph import edge_weights
from stereo_refine_ros.graph.segment_graph import find_borders, group_pixels, SegmentGraph
from stereo_refine_ros.matching.evidence import TOTAL_UNIT
from stereo_refine_ros.matching.match import Match
from stereo_refine_ros.matching.scanline import gather_evidence
from stereo_refine_ros.params import MatchingParams, PlaneParams, PROJECTIONS as NAMES
from stereo_refine_ros.refinement.plane_stage import (
    apply_planes, project_full, project_guarded, PROJECTIONS, unfitted)
from stereo_refine_ros.types import DisparityMap, StereoPair

SHAPE = (18, 30)
RANGE = 12


@pytest.fixture(autouse=True)
def wrapping_allowed():
    """Let unsigned scalars wrap round where the kernels run as plain Python."""
    with np.errstate(over='ignore'):
        yield


def blocks():
    """Return an image of three segments side by side, their labels and planes."""
    labels = np.tile(np.repeat(np.arange(3, dtype=np.int32), 10), (SHAPE[0], 1))
    image = np.array([40, 70, 200], np.uint8)[labels]
    return image, labels, np.array([[0.1, 0.05, 2.0], [0.0, 0.0, 6.0], [-0.1, 0.1, 9.0]])


def describe(image, labels):
    """Gather the graph of an image whose segments are given."""
    return SegmentGraph(labels, 3, group_pixels(labels, 3), find_borders(labels, 3, image),
                          edge_weights(image))


def render(labels, planes):
    y, x = np.indices(labels.shape)
    a, b, c = planes[labels].transpose(2, 0, 1)
    return (a * x + b * y + c).astype(np.float32)


def match_of(values, subpixel=None, first=0, count=RANGE, evidence=None):
    return Match(DisparityMap(values, first, count), subpixel=subpixel, evidence=evidence)


def points_of(labels, data, label):
    y, x = np.nonzero((labels == label) & np.isfinite(data))
    return np.column_stack([x, y, data[y, x]]).astype(float)


def test_unfitted_segments_have_no_plane():
    labels = np.zeros((2, 3), np.int32)
    segments = unfitted(labels, 2)
    assert segments.labels is labels
    assert segments.planes.shape == (2, 3) and np.isnan(segments.planes).all()
    assert segments.is_fitted.tolist() == [False, False]
    assert segments.inlier_ratio.tolist() == [0.0, 0.0]


def test_full_projection_replaces_fitted_segments_and_leaves_the_others():
    image, labels, planes = blocks()
    values = render(labels, planes)
    values[::3, ::4] = np.nan
    rng = np.random.default_rng(0)
    values[:, 20:] = rng.uniform(0, 200, (SHAPE[0], 10))
    values[4, 25] = np.nan
    before = values.copy()
    segments, projected = project_full(
        match_of(values), None, describe(image, labels), PlaneParams())
    assert segments.is_fitted.tolist() == [True, True, False]
    assert np.isnan(segments.planes[2]).all() and segments.inlier_ratio[2] < 0.5
    for label in range(2):
        np.testing.assert_allclose(
            segments.planes[label], plane_reference.ridge_plane(points_of(labels, values, label)),
            rtol=1e-6, atol=1e-6)
    fitted = labels < 2
    np.testing.assert_array_equal(
        projected[fitted], render(labels, segments.planes)[fitted])
    np.testing.assert_array_equal(projected[~fitted], before[~fitted])
    np.testing.assert_array_equal(values, before)


def test_full_projection_fits_the_subpixel_data_where_there_are_some():
    image, labels, planes = blocks()
    subpixel = render(labels, planes)
    match = match_of(np.rint(subpixel) + 2, subpixel)
    _, projected = project_full(match, None, describe(image, labels), PlaneParams())
    assert np.abs(projected - subpixel).max() < 0.2


@pytest.mark.parametrize('first, count', [(0, 5), (4, 3), (7, 30)])
def test_planes_are_limited_to_the_range(first, count):
    image, labels, planes = blocks()
    _, projected = project_full(
        match_of(render(labels, planes), first=first, count=count), None, describe(image, labels),
        PlaneParams())
    assert projected.min() >= first and projected.max() <= first + count - 1


def test_no_data_no_plane_even_where_any_ratio_will_do():
    image, labels, _ = blocks()
    holes = np.full(SHAPE, np.nan, np.float32)
    segments, projected = project_full(
        match_of(holes), None, describe(image, labels), PlaneParams(min_inlier_ratio=0.0))
    assert not segments.is_fitted.any()
    assert np.isnan(projected).all()


def test_guarded_without_evidence_keeps_what_is_valid_and_fills_the_rest():
    image, labels, planes = blocks()
    truth = render(labels, planes)
    values = truth.copy()
    values[5:12, 3:8] = np.nan
    values[2, 12] = 11.0
    segments, projected = project_guarded(
        match_of(values), None, describe(image, labels), PlaneParams())
    valid = np.isfinite(values)
    np.testing.assert_array_equal(projected[valid], values[valid])
    assert segments.is_fitted.all()
    assert np.abs(projected - truth)[~valid].max() < 0.1


def test_a_segment_without_data_adopts_the_plane_of_the_neighbour_it_resembles():
    image, labels, planes = blocks()
    values = render(labels, planes)
    values[labels == 1] = np.nan
    segments, projected = project_guarded(
        match_of(values), None, describe(image, labels), PlaneParams())
    assert segments.is_fitted.tolist() == [True, False, True]
    np.testing.assert_array_equal(segments.planes[1], segments.planes[0])
    inside = labels == 1
    expected = render(labels, segments.planes)
    np.testing.assert_allclose(projected[inside], expected[inside], rtol=1e-6)


def shifted_scene(shift=4):
    """Return the evidence, the left view and three segments of a texture at one disparity."""
    rng = np.random.default_rng(7)
    texture = rng.integers(60, 120, (SHAPE[0], SHAPE[1] + shift, 3), dtype=np.uint8)
    pair = StereoPair(np.ascontiguousarray(texture[:, :SHAPE[1]]),
                      np.ascontiguousarray(texture[:, shift:]))
    evidence = gather_evidence(pair, MatchingParams('scanline', 0, RANGE))[0]
    return evidence, pair.left, blocks()[1]


def test_evidence_moves_valid_pixels_that_the_images_refute():
    evidence, image, labels = shifted_scene()
    values = np.full(SHAPE, 4.0, np.float32)
    values[6:10, 16:20] = 9.0
    values[:, 22:25] = np.nan
    before = values.copy()
    segments, projected = project_guarded(
        match_of(values), evidence, describe(image, labels), PlaneParams())
    np.testing.assert_allclose(projected, 4.0, atol=0.05)
    np.testing.assert_allclose(segments.planes, np.tile([0.0, 0.0, 4.0], (3, 1)), atol=0.01)
    np.testing.assert_array_equal(values, before)


def test_evidence_keeps_valid_pixels_that_the_images_confirm():
    evidence, image, labels = shifted_scene()
    values = np.full(SHAPE, 9.0, np.float32)
    values[:, 10:14] = 4.0
    segments, projected = project_guarded(
        match_of(values, evidence=evidence), evidence, describe(image, labels), PlaneParams())
    np.testing.assert_array_equal(segments.planes[1], [0.0, 0.0, 9.0])
    assert np.all(projected[:, 10:14] == 4.0)


@pytest.mark.parametrize('spread', [False, True])
@pytest.mark.parametrize('has_evidence', [False, True])
def test_a_map_of_holes_stays_one(spread, has_evidence):
    evidence, image, labels = shifted_scene()
    evidence = evidence if has_evidence else None
    holes = np.full(SHAPE, np.nan, np.float32)
    segments, projected = project_guarded(
        match_of(holes, evidence=evidence), evidence, describe(image, labels),
        PlaneParams(spread=spread))
    assert np.isnan(projected).all()
    assert not segments.is_fitted.any() and np.isnan(segments.planes).all()


def test_matched_pixels_outvote_a_wrong_one_and_keep_their_subpixel_disparity():
    evidence, image, labels = shifted_scene()
    values = np.full(SHAPE, 4.2, np.float32)
    values[:, ::2] = 4.3
    values[9, 14], values[:, 20:23] = 8.0, np.nan
    _, projected = project_guarded(
        match_of(values, evidence=evidence), evidence, describe(image, labels),
        PlaneParams(spread=True))
    inner = (slice(3, -3), slice(None, 18))
    expected = values.copy()
    expected[9, 14] = projected[9, 14]
    np.testing.assert_array_equal(projected[inner], expected[inner])
    # No whole disparity is left, not even where nothing had matched.
    np.testing.assert_allclose(projected, 4.25, atol=0.15)


def test_what_a_matcher_said_stays_where_the_plane_says_nearly_the_same():
    evidence, image, labels = shifted_scene()
    values = np.full(SHAPE, 4.0, np.float32)
    values[::2] = 4.25
    _, projected = project_guarded(
        match_of(values), evidence, describe(image, labels), PlaneParams())
    np.testing.assert_array_equal(projected, values)


@pytest.mark.parametrize('rows, side, stays', [(1, 7, False), (1, 8, True), (4, 4, True)])
def test_a_speckle_of_the_scanline_matcher_stays_only_where_it_is_large(rows, side, stays):
    evidence, image, labels = shifted_scene()
    values = np.full(SHAPE, 4.0, np.float32)
    values[4:4 + side, 11:11 + side] = 9.0
    blind = dataclasses.replace(evidence, total=np.zeros_like(evidence.total),
                                least=np.zeros_like(evidence.least))
    blind.right[:] = -1
    _, projected = project_guarded(
        match_of(values, evidence=blind), blind, describe(image, labels), PlaneParams(), rows=rows)
    assert (projected[7, 12] == 9.0) == stays


@pytest.mark.parametrize('is_own, rows, stays', [
    (True, 1, False), (True, 2, False), (False, 1, False), (False, 2, True)])
def test_on_averaged_rows_a_foreign_map_is_held_on_to(is_own, rows, stays):
    evidence, image, labels = shifted_scene()
    values = np.full(SHAPE, 4.0, np.float32)
    values[2:16, 20:26] = 9.0
    # The images find 9 px worse than the plane by 0.15, and know of no other difference.
    total = np.zeros_like(evidence.total)
    total[..., 9] = int(0.15 * TOTAL_UNIT)
    right = np.full_like(evidence.right, 4)
    right[2:16, 11:17] = 9
    even = dataclasses.replace(
        evidence, total=total, least=np.zeros_like(evidence.least), right=right)
    _, projected = project_guarded(
        match_of(values, evidence=even if is_own else None), even, describe(image, labels),
        PlaneParams(), rows=rows)
    assert np.all(projected[2:16, 21:25] == 9.0) == stays


@pytest.mark.compiled
@pytest.mark.parametrize('threads', [2, 3])
def test_threads_do_not_change_a_bit(threads):
    evidence, image, labels = shifted_scene()
    values = np.random.default_rng(2).uniform(2, 6, SHAPE).astype(np.float32)
    args = (match_of(values, evidence=evidence), evidence, describe(image, labels),
            PlaneParams(spread=True))
    segments, projected = project_guarded(*args)
    segments_again, again = project_guarded(*args, threads)
    np.testing.assert_array_equal(again, projected)
    np.testing.assert_array_equal(segments_again.planes, segments.planes)


def test_every_projection_that_can_be_asked_for_is_there():
    assert sorted(PROJECTIONS) == sorted(NAMES)
    image, labels, planes = blocks()
    match = match_of(render(labels, planes))
    segments, values = apply_planes(
        match, None, describe(image, labels), PlaneParams(projection='off'))
    assert values is match.disparity.values and not segments.is_fitted.any()
    with pytest.raises(ValueError, match="'magic' is none of off, full, guarded"):
        apply_planes(match, None, describe(image, labels), PlaneParams(projection='magic'))

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

"""The plane stage: every projection on maps whose truth is known."""

from dataclasses import replace

import numpy as np
import plane_reference
import pytest

from stereo_refine_ros.graph.pixel_graph import edge_weights
from stereo_refine_ros.graph.segment_graph import find_borders, group_pixels, SegmentGraph
from stereo_refine_ros.params import PlaneParams, PROJECTIONS as NAMES
from stereo_refine_ros.refinement.filling import fill_from_background
from stereo_refine_ros.refinement.likelihood import Evidence
from stereo_refine_ros.refinement.plane_stage import (
    PlaneStage, project_full, project_guarded, project_off, PROJECTIONS, share_planes, unfitted)
from stereo_refine_ros.refinement.tuning import ADOPTED_QUALITY

SHAPE = (18, 30)
RANGE = 12
PLANES = np.array([[0.1, 0.05, 2.0], [0.0, 0.0, 6.0], [-0.1, 0.1, 9.0]])
LABELS = np.tile(np.repeat(np.arange(3, dtype=np.int32), 10), (SHAPE[0], 1))
IMAGE = np.array([40, 70, 200], np.uint8)[LABELS]
PARAMS = PlaneParams()
N = np.nan


@pytest.fixture(autouse=True)
def wrapping_allowed():
    """Let unsigned scalars wrap round where the kernels run as plain Python."""
    with np.errstate(over='ignore'):
        yield


def render(planes=PLANES):
    y, x = np.indices(SHAPE)
    a, b, c = np.asarray(planes)[LABELS].transpose(2, 0, 1)
    return (a * x + b * y + c).astype(np.float32)


def stage_of(given, data=None, first=0, count=RANGE, matched=None, has_right=True):
    """Return a stage on three segments; the matches say `matched`, or what was given."""
    graph = SegmentGraph(LABELS, 3, group_pixels(LABELS, 3), find_borders(LABELS, 3, IMAGE),
                         edge_weights(IMAGE))
    nothing = np.full(SHAPE, N, np.float32)
    fine = given if matched is None else matched
    evidence = Evidence(IMAGE, 1, fine, nothing if matched is None else matched,
                        np.full(SHAPE, 0.5, np.float32), nothing, has_right)
    return PlaneStage(given, given if data is None else data, graph, evidence, float(first),
                      first + count - 1.0)


def points_of(data, label):
    y, x = np.nonzero((LABELS == label) & np.isfinite(data))
    return np.column_stack([x, y, data[y, x]]).astype(float)


def holed_map():
    """Return the planes with holes; the third segment is noise."""
    values = render()
    values[::3, ::4] = N
    values[:, 20:] = np.random.default_rng(0).uniform(0, 200, (SHAPE[0], 10))
    values[4, 25] = N
    return values


def test_unfitted_segments_have_no_plane():
    segments = unfitted(LABELS, 2)
    assert segments.labels is LABELS
    assert segments.planes.shape == (2, 3) and np.isnan(segments.planes).all()
    assert segments.is_fitted.tolist() == [False, False]
    assert segments.inlier_ratio.tolist() == [0.0, 0.0]
    assert segments.plane_index.tolist() == [-1, -1]


def test_off_leaves_the_map_as_it_came():
    values = holed_map()
    projected = project_off(stage_of(values), PARAMS)
    assert projected.choice.given is projected.choice.values is values
    assert projected.choice.is_literal and not projected.choice.is_moved.any()
    assert not projected.segments.is_fitted.any()
    assert np.isfinite(projected.odds).all()


def test_full_projection_replaces_fitted_segments_and_leaves_the_others():
    values = holed_map()
    before = values.copy()
    projected = project_full(stage_of(values, count=300), PARAMS)
    segments, found = projected.segments, projected.choice.values
    assert segments.is_fitted.tolist() == [True, True, False]
    assert np.isnan(segments.planes[2]).all() and segments.inlier_ratio[2] < 0.5
    for label in range(2):
        np.testing.assert_allclose(
            segments.planes[label], plane_reference.ridge_plane(points_of(values, label)),
            rtol=1e-6, atol=1e-6)
    fitted = LABELS < 2
    np.testing.assert_array_equal(projected.choice.is_moved, fitted)
    np.testing.assert_array_equal(found[fitted], render(segments.planes)[fitted])
    np.testing.assert_array_equal(found[~fitted], before[~fitted])
    assert projected.choice.is_literal
    np.testing.assert_array_equal(values, before)


def test_planes_are_fitted_to_what_the_matcher_measured_below_its_map():
    measured = render()
    for project in (project_full, project_guarded):
        stage = stage_of(np.rint(measured) + 2, measured, count=300)
        segments = project(stage, PARAMS).segments
        assert np.abs(render(segments.planes) - measured).max() < 0.2


@pytest.mark.parametrize('first, count', [(0, 5), (4, 3), (7, 30)])
@pytest.mark.parametrize('name', ['full', 'guarded'])
def test_planes_are_limited_to_the_range(name, first, count):
    given = np.where(LABELS == 1, np.float32(first), N).astype(np.float32)
    found = PROJECTIONS[name](stage_of(given, render(), first, count), PARAMS, 1).choice.values
    assert np.nanmin(found) >= first and np.nanmax(found) <= first + count - 1


@pytest.mark.parametrize('name', NAMES)
@pytest.mark.parametrize('has_right', [True, False])
def test_a_map_of_holes_stays_one_and_nothing_is_sure(name, has_right):
    holes = np.full(SHAPE, N, np.float32)
    projected = PROJECTIONS[name](
        stage_of(holes, has_right=has_right), PlaneParams(min_inlier_ratio=0.0), 1)
    assert np.isnan(projected.choice.values).all()
    assert not projected.segments.is_fitted.any() and np.isnan(projected.segments.planes).all()
    assert np.all(projected.odds == -np.inf)


def test_guarded_fills_every_hole_and_keeps_what_the_matches_confirm():
    truth = render()
    values = truth.copy()
    values[5:12, 3:8] = N
    values[:, 19] = N
    before = values.copy()
    projected = project_guarded(stage_of(values), PARAMS)
    choice, valid = projected.choice, np.isfinite(values)
    assert not choice.is_literal and choice.given is values
    np.testing.assert_array_equal(choice.values[valid], values[valid])
    assert not choice.is_moved[valid].any()
    assert np.abs(choice.values - truth).max() < 0.51
    assert projected.segments.is_fitted.all()
    np.testing.assert_array_equal(values, before)


def test_guarded_puts_right_within_its_rounding_what_was_rounded():
    truth = render()
    stage = replace(stage_of(np.rint(truth), truth), rounding=0.5)
    choice = project_guarded(stage, PARAMS).choice
    assert choice.rounding == 0.5 and not choice.is_moved.any()
    assert np.abs(choice.values - stage.given).max() <= 0.5
    before, after = (np.abs(values - truth) for values in (stage.given, choice.values))
    assert before.mean() > 0.15 and after.mean() < 0.02
    literal = project_full(stage, PARAMS).choice
    assert literal.rounding == 0


def test_guarded_moves_what_planes_matches_and_neighbours_refute():
    truth = np.full(SHAPE, 4, np.float32)
    given = truth.copy()
    given[4:12, 13:18] = 9.0
    # A map that is nowhere smooth is not taken for a network's.
    given += np.float32(0.35) * (np.indices(SHAPE).sum(0) % 2)
    projected = project_guarded(stage_of(given, truth, matched=truth), PARAMS)
    wrong = np.abs(given - truth) > 1
    np.testing.assert_allclose(projected.choice.values[wrong], 4, atol=0.5)
    assert projected.choice.is_moved[wrong].all()
    np.testing.assert_array_equal(projected.choice.values[~wrong], given[~wrong])


def test_a_pixel_is_surer_the_more_speaks_for_it():
    values = render()
    values[:, 21:] = N
    sure = project_guarded(stage_of(values), PARAMS).odds
    assert sure.dtype == np.float32 and sure.shape == SHAPE
    assert sure[:, :18].min() > sure[:, 26:].max()


def test_a_segment_without_data_adopts_the_plane_of_the_neighbour_it_resembles():
    values = render()
    values[LABELS == 1] = N
    segments, planes = share_planes(stage_of(values), PARAMS, 1)
    assert segments.is_fitted.tolist() == [True, False, True]
    np.testing.assert_array_equal(segments.planes[1], segments.planes[0])
    assert segments.plane_index[1] == segments.plane_index[0]
    inside = LABELS == 1
    np.testing.assert_allclose(planes.values[inside], render(segments.planes)[inside], rtol=1e-6)
    assert np.all(planes.quality[inside] == np.float32(ADOPTED_QUALITY))
    np.testing.assert_array_equal(planes.quality[~inside], segments.inlier_ratio[LABELS][~inside])
    assert np.all(planes.behind <= planes.before)


def test_where_no_segment_has_data_no_plane_is_believed():
    segments, planes = share_planes(stage_of(np.full(SHAPE, N, np.float32)), PARAMS, 1)
    assert np.all(planes.quality == 0) and np.isnan(planes.values).all()
    assert segments.plane_index.tolist() == [-1, -1, -1]


def test_whatever_is_chosen_was_a_candidate():
    rng = np.random.default_rng(3)
    given = holed_map()
    matched = rng.uniform(0, RANGE, SHAPE).astype(np.float32)
    stage = stage_of(given, render(), matched=matched)
    found = project_guarded(stage, PARAMS).choice
    _, planes = share_planes(stage, PARAMS, 1)
    options = np.stack([fill_from_background(given), planes.values, planes.behind, planes.before,
                        matched])
    assert np.all((found.values == options).any(axis=0))
    still = ~found.is_moved
    np.testing.assert_array_equal(found.values[still], options[0][still])


@pytest.mark.compiled
@pytest.mark.parametrize('name', NAMES)
def test_threads_do_not_change_a_bit(name):
    rng = np.random.default_rng(2)
    stage = stage_of(rng.uniform(2, 6, SHAPE).astype(np.float32), matched=render())
    first = PROJECTIONS[name](stage, PARAMS, 1)
    for threads in (2, 3):
        again = PROJECTIONS[name](stage, PARAMS, threads)
        np.testing.assert_array_equal(again.choice.values, first.choice.values)
        np.testing.assert_array_equal(again.odds, first.odds)
        np.testing.assert_array_equal(again.segments.planes, first.segments.planes)


def test_every_projection_that_can_be_asked_for_is_there():
    assert sorted(PROJECTIONS) == sorted(NAMES)

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

"""How maps that follow the image's edges are told from others, and what they get back."""

import numpy as np
import pytest

from stereo_refine_ros.refinement import trust
from stereo_refine_ros.refinement.trust import (
    count_steps, find_overruled, follows_edges, take_back)

NAN = np.nan


def reference_counts(values, image):
    """Count as `count_steps` does, row by row and with slices."""
    steps, hits = [0, 0], [0, 0]
    for row, colors in zip(values, image.reshape(*values.shape, -1).astype(int), strict=True):
        rises = np.diff(row)
        edges = np.abs(np.diff(colors, axis=0)).max(axis=1)
        for x, rise in enumerate(rises):
            near = np.abs(rises[max(x - 2, 0):x + 3])
            before = np.abs(rises[max(x - 2, 0):x])
            if not abs(rise) > 0.75 or np.any(near > abs(rise)) or abs(rise) in before:
                continue
            ends = row[max(x - 2, 0):x + 4][[0, -1]]
            whole = abs(ends[1] - ends[0])
            around = edges[max(x - 4, 0):x + 5]
            if not (abs(rise) > 1.5 or whole > 1.5) or around.max() < 10:
                continue
            steps[int(rise > 0)] += 1
            place = max(x - 4, 0) + int(np.argmax(around))
            hits[int(rise > 0)] += abs(place - x) <= 1 and not abs(rise) < 0.7 * whole
    return steps, hits


def boxes(shift=0, blur=1):
    """Return a map with boxes, moved and blurred along rows, and the image of the boxes."""
    truth = np.full((40, 120), 5, np.float32)
    image = np.full((40, 120, 3), 60, np.uint8)
    for x, disparity in ((10, 12), (40, 15), (80, 9)):
        truth[5:35, x:x + 20] = disparity
        image[5:35, x:x + 20] = 10 * disparity
    moved = np.roll(truth, shift, axis=1)
    kernel = np.ones(blur) / blur
    padded = np.pad(moved, ((0, 0), (blur // 2, blur // 2)), mode='edge')
    blurred = [np.convolve(row, kernel, 'valid') for row in padded]
    return np.array(blurred, np.float32), image


@pytest.mark.parametrize('seed', range(4))
@pytest.mark.parametrize('shape', [(6, 40), (3, 7), (2, 2), (4, 1), (1, 1)])
def test_steps_are_counted_as_slowly(seed, shape):
    rng = np.random.default_rng(seed)
    values = np.cumsum(rng.choice([0, 0, 0, 0.8, -0.8, 2, -2, 6, -6], shape), axis=1)
    values[rng.random(shape) < 0.05] = NAN
    image = rng.integers(0, 256, (*shape, 3), dtype=np.uint8) // np.uint8(rng.choice([1, 12, 40]))
    for view in (image, image[..., 0]):
        steps, hits = count_steps(values.astype(np.float32), view)
        expected = reference_counts(values.astype(np.float32), view)
        assert (steps.tolist(), hits.tolist()) == tuple(list(map(float, n)) for n in expected)


def test_sharp_steps_at_edges_are_trusted_on_both_sides():
    steps, hits = count_steps(*boxes())
    assert steps.tolist() == hits.tolist() == [90, 90]
    assert follows_edges(*boxes())
    assert follows_edges(*boxes(shift=1))


@pytest.mark.parametrize('values, image', [boxes(shift=3), boxes(blur=5)],
                         ids=['beside', 'blurred'])
def test_steps_beside_the_edges_and_blurred_ones_are_not(values, image):
    assert not follows_edges(values, image)


def test_one_side_alone_is_not_enough():
    values, image = boxes()
    for x in (10, 40, 80):
        values[:, x - 2:x] = NAN  # the left side of everything is lost in a hole
    steps, hits = count_steps(values, image)
    assert (steps.tolist(), hits.tolist()) == ([90, 0], [90, 0])
    assert not follows_edges(values, image)


def test_a_few_steps_prove_nothing():
    values, image = boxes()
    steps, hits = count_steps(values[4:6], image[4:6])
    assert steps.tolist() == hits.tolist() == [3, 3]
    assert follows_edges(values[4:6], image[4:6])
    values[5, 10] = values[5, 40] = 5  # two of three are one pixel off: still near
    values[5, 30:34] = values[5, 60:64] = 12
    assert not follows_edges(values[4:6], image[4:6])


@pytest.mark.parametrize('fill', [7.0, NAN])
def test_a_map_without_steps_is_not_trusted(fill):
    assert not follows_edges(np.full((8, 9), fill, np.float32), np.zeros((8, 9), np.uint8))


def test_only_large_regions_of_another_surface_overrule():
    given = np.full((30, 40), 5, np.float32)
    projected = given.copy()
    projected[:10, :10] = 8.0  # 100 pixels
    projected[:10, 20:30] = 2.0
    projected[0, 20] = 5.9  # one less than 100
    projected[20:, :20] = 5.9
    given[20:, 20:] = NAN
    expected = np.zeros((30, 40), np.bool_)
    expected[:11, :11] = True
    np.testing.assert_array_equal(find_overruled(projected, given, 1, 30), expected)
    # As averages of two rows they are all twice as large; the image has one row less.
    doubled = np.zeros((59, 40), np.bool_)
    doubled[:21, :11] = doubled[:21, 19:31] = True
    doubled[0, 19] = False  # only the corner was missing
    np.testing.assert_array_equal(find_overruled(projected, given, 2, 59), doubled)


def test_a_map_without_noise_comes_back_but_for_its_holes_and_what_was_overruled():
    given = np.full((12, 12), 4.0, np.float32)
    given[2, 2] = NAN
    refined = given + np.float32(0.2)
    refined[2, 2], refined[6, 6] = 7.0, 9.0
    overruled = np.zeros((12, 12), np.bool_)
    overruled[6, 6] = True
    back = take_back(refined, given, overruled)
    expected = np.full((12, 12), 4.0, np.float32)
    expected[2, 2], expected[6, 6] = 7.0, 9.0
    np.testing.assert_array_equal(back, expected)


def test_the_shape_of_things_is_not_noise():
    y, x = np.mgrid[:40, :40].astype(np.float32)
    given = (20 + np.hypot(x - 20, y - 20) * np.sin(x / 3) / 20).astype(np.float32)
    refined = given + np.float32(0.03)
    nowhere = np.zeros(given.shape, np.bool_)
    np.testing.assert_array_equal(take_back(refined, given, nowhere), given)


def test_changes_within_the_noise_stay():
    rng = np.random.default_rng(0)
    clean = np.full((80, 80), 4.0, np.float32)
    given = clean + rng.normal(0, 0.2, clean.shape).astype(np.float32)
    refined = clean.copy()
    refined[40, 40] += 3.0
    back = take_back(refined, given, np.zeros(clean.shape, np.bool_))
    kept = np.abs(refined - given) > 1.0
    assert kept[40, 40] and back[40, 40] == given[40, 40]
    near = np.abs(clean - given) < 0.5 * trust._NOISE_REACH * 0.2
    near[40, 40] = False
    np.testing.assert_array_equal(back[near], clean[near])
    assert near.mean() > 0.8

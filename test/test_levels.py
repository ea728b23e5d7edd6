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

"""Two resolutions around the stages: to the grid, and back to the pixels of the image."""

import numpy as np
import pytest

from stereo_refine_ros import levels
from stereo_refine_ros.levels import (
    at_full_size, Choice, grid_scale, halve_pair, repeated, segments_at_full_size, to_grid,
    unround)
from stereo_refine_ros.types import PlaneSegmentation, StereoPair

N = np.nan


def full_size(chosen, given, left=None, grid_left=None, grid_given=None, is_moved=True,
              is_literal=False, rounding=0.0, threads=1):
    """Bring a half-size map to full size; all of it is moved and of one colour, if not said."""
    chosen, given = np.float32(chosen), np.float32(given)
    choice = Choice(
        np.full_like(chosen, N) if grid_given is None else np.float32(grid_given), chosen,
        np.broadcast_to(is_moved, chosen.shape).copy(), is_literal, rounding)
    left = np.zeros(given.shape, np.uint8) if left is None else left
    grid_left = np.zeros(chosen.shape, np.uint8) if grid_left is None else grid_left
    return at_full_size(choice, given, left, grid_left, 2, threads)


def test_the_grid_is_the_image_up_to_the_limit():
    assert grid_scale((100, 100), 0.01) == 1
    assert grid_scale((100, 101), 0.01) == 2
    assert grid_scale((1, 1), 0.0) == 2


def test_a_pixel_of_the_grid_is_the_mean_of_what_lies_near_its_first_valid_one():
    values = np.float32([
        [1.0, 2.0, N, 4.0, 9.0],
        [1.5, 5.0, 6.0, 3.5, 8.0],
        [N, N, 3.0, N, N]])
    expected = [[1.5, 3.75, 8.5], [N, 3.0, N]]
    np.testing.assert_array_equal(to_grid(values, 2), np.float32(expected))
    np.testing.assert_array_equal(
        to_grid(np.asfortranarray(values), 2), np.float32(expected))
    assert to_grid(values, 1) is values


def test_both_views_are_halved_where_there_are_two():
    views = np.arange(24, dtype=np.uint8).reshape(2, 3, 4)
    half = halve_pair(StereoPair(views[0], views[1]))
    assert half.left.tolist() == [[3, 5], [9, 11]]  # means of four; the last row counts twice
    assert half.right.shape == (2, 2)
    assert halve_pair(StereoPair(views[0], None)).right is None


def test_every_pixel_has_what_its_pixel_of_the_grid_has():
    values = np.int32([[1, 2], [3, 4]])
    assert repeated(values, (3, 3), 2).tolist() == [[1, 1, 2], [1, 1, 2], [3, 3, 4]]
    assert repeated(values, (2, 2), 1) is values


def test_planes_at_full_size_are_those_of_the_grid():
    labels = np.array([[0, 0, 1], [0, 1, 1]], np.int32)
    planes = np.array([[0.5, -0.25, 7.0], [-0.1, 0.3, 20.0]])
    segments = PlaneSegmentation(labels, planes, np.array([True, False]), np.float32([0.9, 0.1]),
                                 np.int32([4, 4]))
    full = segments_at_full_size(segments, (3, 6), 2)
    np.testing.assert_array_equal(full.labels, labels.repeat(2, 0).repeat(2, 1)[:3, :6])
    assert full.labels.flags.c_contiguous and full.labels.dtype == np.int32
    assert full.planes.dtype == np.float64
    for name in ('is_fitted', 'inlier_ratio', 'plane_index'):
        assert getattr(full, name) is getattr(segments, name)
    y, x = np.indices((4, 6))
    for label in range(2):
        a, b, c = planes[label]
        found = full.planes[label] @ [x.ravel(), y.ravel(), np.ones(x.size)]
        of_four = found.reshape(2, 2, 3, 2).mean(axis=(1, 3))
        np.testing.assert_allclose(of_four, a * x[:2, :3] + b * y[:2, :3] + c, atol=1e-12)
    assert segments_at_full_size(segments, (2, 3), 1) is segments


def test_where_the_grid_is_the_image_its_values_are_the_map():
    given = np.float32([[1, 2, N]])
    choice = Choice(given, np.float32([[5, 2, 7]]), np.array([[True, False, False]]))
    image = np.zeros((1, 3), np.uint8)
    out = at_full_size(choice, given, image, image, 1)
    np.testing.assert_array_equal(out, [[5, 2, 7]])
    assert not np.shares_memory(out, choice.values)


def test_what_was_rounded_goes_towards_a_finer_map_within_its_rounding():
    rounded = np.float32([[8, 8, 8, 8, 8, 8]])
    finer = np.float32([[8.25, 7.25, 9.0, 9.25, N, 8.25]])
    where = np.array([[True, True, True, True, True, False]])
    found = unround(rounded, finer, 0.5, where)
    np.testing.assert_array_equal(found, np.float32([[8.25, 7.5, 8.5, 8, 8, 8]]))
    assert found.dtype == np.float32


def test_what_stands_at_full_size_takes_the_grid_within_its_rounding():
    given = np.float32([[8, 8, 9, 9, 9, 9], [8, 8, 9, 9, 9, 30]])
    slanted = np.float32([[8.0, 8.5, 9.0]])  # between: 8, 8.125, 8.375, 8.625, 8.875, 9
    out = full_size(slanted, given, grid_given=[[8, 9, 9]], is_moved=False, rounding=0.5)
    expected = [[8, 8.125, 8.5, 8.625, 8.875, 9], [8, 8.125, 8.5, 8.625, 8.875, 30]]
    np.testing.assert_array_equal(out, np.float32(expected))
    far = full_size([[8.0, 30.0, 30.0]], given, grid_given=[[8, 9, 9]], is_moved=False,
                    rounding=0.5)
    np.testing.assert_array_equal(far, given)  # no finer map of this surface


def test_what_was_given_stays_bit_by_bit_where_its_pixel_did_not_move():
    given = np.random.default_rng(0).uniform(3, 9, (5, 7)).astype(np.float32)
    out = full_size(np.full((3, 4), 30.0), given, is_moved=False)
    np.testing.assert_array_equal(out, given)
    assert not np.shares_memory(out, given)


def test_of_a_moved_pixel_only_what_lay_on_its_surface_moves():
    given = np.float32([[6.0, 6.5, 6.0, 12.0], [6.0, 6.0, 20.4, N]])
    out = full_size([[20.0, 20.0]], given, grid_given=[[6.125, 6.0]])
    # 12 lies on another surface than the 6 that moved, 20.4 where the other went.
    np.testing.assert_array_equal(out, np.float32([[20, 20, 20, 12], [20, 20, 20.4, 20]]))


def test_a_smooth_grid_is_interpolated_in_its_plane():
    gy, gx = np.indices((6, 8))
    out = full_size(0.5 * gx - 0.25 * gy + 9, np.full((12, 16), N))
    y, x = np.indices((12, 16))
    expected = 0.25 * x - 0.125 * y + 9 - 0.0625
    inside = slice(1, -1)
    np.testing.assert_allclose(out[inside, inside], expected[inside, inside], atol=1e-5)
    # Beyond the outermost pixels of the grid their value goes on.
    assert out[0, 0] == 9.0 and out[-1, -1] == np.float32(0.5 * 7 - 0.25 * 5 + 9)


@pytest.mark.parametrize('channels', [1, 3])
def test_at_a_step_the_colour_says_which_side_a_pixel_is_on(channels):
    left = np.full((4, 8, channels), 20, np.uint8)
    left[:, 3:] = 200  # the grid's third column of pixels is half on either side
    grid_left = np.full((2, 4, channels), 20, np.uint8)
    grid_left[:, 2:] = 200
    grid_left[:, 1] = 110
    chosen = np.float32([[3, 3, 20, 20]] * 2)
    left, grid_left = np.squeeze(left, 2) if channels == 1 else left, (
        np.squeeze(grid_left, 2) if channels == 1 else grid_left)
    out = full_size(chosen, np.full((4, 8), N), left, grid_left)
    np.testing.assert_array_equal(out, np.float32([[3, 3, 3, 20, 20, 20, 20, 20]] * 4))


def test_of_two_alike_the_nearer_is_taken():
    out = full_size([[3, 20]], np.full((2, 4), N))
    np.testing.assert_array_equal(out, np.float32([[3, 3, 20, 20]] * 2))


def test_a_literal_choice_leaves_holes_and_moves_all_that_it_moves():
    given = np.float32([[6.0, N, 6.0, 40.0], [N, 6.0, N, 6.0]])
    out = full_size([[6.0, 21.0]], given, grid_given=[[6.0, 6.0]],
                    is_moved=np.array([[False, True]]), is_literal=True)
    np.testing.assert_array_equal(out[:, :2], given[:, :2])
    assert np.isfinite(out[:, 2:]).all() and np.all(out[:, 3] == 21)


@pytest.mark.compiled
def test_threads_change_no_bit():
    rng = np.random.default_rng(5)
    chosen = rng.uniform(0, 20, (16, 20)).astype(np.float32)
    given = rng.uniform(0, 20, (31, 39)).astype(np.float32)
    given[rng.random(given.shape) < 0.3] = N
    left = rng.integers(0, 256, (31, 39, 3), dtype=np.uint8)
    moved = rng.random(chosen.shape) < 0.5
    args = chosen, given, left, levels.halve(left), to_grid(given, 2), moved
    expected = full_size(*args)
    assert np.isfinite(expected).all()
    for threads in (2, 3, 5):
        np.testing.assert_array_equal(full_size(*args, threads=threads), expected)

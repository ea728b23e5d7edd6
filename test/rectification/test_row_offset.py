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

"""Row offsets of made-up pairs: found to a tenth of a row, undone, or left alone."""

import cv2
import numpy as np
import pytest

from stereo_refine_ros.rectification import (
    find_row_offset, measure_row_offset, RowOffset, undo_row_offset)

pytestmark = pytest.mark.compiled

SHAPE = 480, 640


def texture(shape, seed, sigma=2.0):
    noise = np.random.default_rng(seed).normal(size=shape).astype(np.float32)
    smooth = cv2.GaussianBlur(noise, (0, 0), sigma)
    return (128 + 40 * smooth / smooth.std()).astype(np.float32)


def pair(offset, disparity=20.0, shape=SHAPE, seed=0, sigma=2.0):
    """Render a plane that comes nearer downwards, its right view by `offset` off its rows."""
    height, width = shape
    right = texture((height, width + 600), seed, sigma)
    y, x = np.mgrid[:height, :width].astype(np.float32)
    slant = disparity + 0.02 * (y - height / 2)
    # Right view: column x of it shows column x of the world, left view x - d.
    left = cv2.remap(right, x - slant + 300, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
    seen = cv2.remap(right, x + 300, y - offset.at(shape), cv2.INTER_CUBIC,
                     borderMode=cv2.BORDER_REFLECT)
    return tuple(np.rint(view).clip(0, 255).astype(np.uint8) for view in (left, seen))


@pytest.mark.parametrize('offset', [
    RowOffset(0.5), RowOffset(-1.0), RowOffset(2.0), RowOffset(4.0), RowOffset(-4.0),
    RowOffset(tilt_px=2.2), RowOffset(0.4, -1.5), RowOffset(stretch_px=1.4),
    RowOffset(-0.3, 0.8, -1.2), RowOffset(0.2, 0, 0, 5.8)], ids=str)
def test_offset_is_found_to_a_tenth_of_a_row(offset):
    found = find_row_offset(*pair(offset), 0, 64)
    error = RowOffset.of(np.subtract(found.terms, offset.terms), 0)
    assert abs(error.offset_px) <= 0.05
    assert error.largest_px <= 0.15
    assert found.largest_px == pytest.approx(offset.largest_px, abs=0.15)


@pytest.mark.parametrize('disparity, lowest, count', [
    (5, 0, 16), (60, 0, 64), (120, 0, 128), (240, 0, 256), (130, 100, 64), (-30, -64, 64),
    (0, -32, 64)])
def test_any_range_of_disparities(disparity, lowest, count):
    found = find_row_offset(*pair(RowOffset(1.0), disparity), lowest, count)
    assert found.offset_px == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize('shape', [
    (96, 128), (120, 160), (240, 320), (288, 384), (375, 450), (370, 1242), (1080, 1920)])
def test_any_size_of_image(shape):
    found = find_row_offset(*pair(RowOffset(1.0), shape=shape), 0, 64)
    assert found.largest_px == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize('seed', range(4))
def test_no_offset_is_exactly_none(seed):
    left, right = pair(RowOffset(), seed=seed)
    found = find_row_offset(left, right, 0, 64)
    assert found.is_zero
    assert found.points >= 60
    assert found.largest_px == 0
    assert undo_row_offset(right, found) is right


@pytest.mark.parametrize('gain, level', [(0.8, -8), (1.2, 5), (0.5, 60)])
def test_unequal_brightness_does_not_matter(gain, level):
    left, right = pair(RowOffset(1.0))
    changed = np.rint(gain * right.astype(np.float32) + level).clip(0, 255).astype(np.uint8)
    found = find_row_offset(left, changed, 0, 64)
    assert found.offset_px == pytest.approx(1.0, abs=0.05)


def test_colour_is_taken_as_its_grey():
    left, right = pair(RowOffset(1.0))
    colour = [cv2.cvtColor(view, cv2.COLOR_GRAY2BGR) for view in (left, right)]
    assert find_row_offset(*colour, 0, 64) == find_row_offset(left, right, 0, 64)


def plain():
    return np.full(SHAPE, 128, np.uint8)


def stripes():
    """Return vertical bars, which look alike on all rows."""
    return np.broadcast_to(np.where(np.arange(SHAPE[1]) // 20 % 2, 200, 60).astype(np.uint8),
                           SHAPE).copy()


def level_stripes():
    """Return level bars, which show rows but no column."""
    return stripes()[:, :SHAPE[0]].T.repeat(2, axis=1)[:, :SHAPE[1]].copy()


def noise(seed):
    return np.random.default_rng(seed).integers(0, 256, SHAPE, np.uint8)


@pytest.mark.parametrize('left, right', [
    (plain(), plain()), (np.zeros(SHAPE, np.uint8), plain()), (stripes(), stripes()),
    (level_stripes(), level_stripes()), (noise(0), noise(1)),
    (texture(SHAPE, 0).clip(0, 255).astype(np.uint8), plain()),
    (np.zeros((1, 1), np.uint8), np.zeros((1, 1), np.uint8)),
    (noise(0)[:20], noise(1)[:20]), (noise(0)[:, :20], noise(1)[:, :20])],
    ids=['plain', 'black', 'bars', 'level bars', 'noise', 'covered', 'one pixel', 'flat', 'thin'])
def test_without_evidence_nothing_is_done(left, right):
    assert find_row_offset(left, right, 0, 64).is_zero


def test_unrelated_views_have_no_offset():
    views = [texture(SHAPE, seed).clip(0, 255).astype(np.uint8) for seed in (0, 1)]
    found = measure_row_offset(*views, 0, 64)
    assert found == RowOffset()


def test_few_textured_pixels_suffice():
    left, right = pair(RowOffset(1.0))
    is_seen = np.zeros(SHAPE, bool)
    is_seen[100:260, 150:450] = True
    left, right = (np.where(is_seen, view, 128).astype(np.uint8) for view in (left, right))
    found = find_row_offset(left, right, 0, 64)
    assert found.offset_px == pytest.approx(1.0, abs=0.1)


def test_repeated_texture_is_no_trap():
    """A tile every 40 columns: which one a point belongs to is open, its row is not."""
    height, width = SHAPE
    tile = texture((height + 8, 40), 3)
    world = np.tile(cv2.GaussianBlur(tile, (0, 0), 1.0), (1, 20))[:, :width]
    left = np.rint(world[4:4 + height]).astype(np.uint8)
    right = np.rint(world[3:3 + height]).astype(np.uint8)
    found = find_row_offset(left, right, 0, 64)
    assert found.offset_px == pytest.approx(1.0, abs=0.05)


def test_moving_things_are_outvoted():
    """Something large is elsewhere in the right view, by three rows."""
    left, right = pair(RowOffset(0.5))
    right[100:400, 330:550] = np.roll(right, 3, axis=0)[100:400, 330:550]
    found = find_row_offset(left, right, 0, 64)
    assert found.offset_px == pytest.approx(0.5, abs=0.1)
    assert found.largest_px == pytest.approx(0.5, abs=0.15)


def test_same_input_gives_the_same_bits():
    left, right = pair(RowOffset(0.7, 1.0))
    first = measure_row_offset(left, right, 0, 64)
    cv2.setNumThreads(1)
    try:
        assert measure_row_offset(left.copy(), right.copy(), 0, 64) == first
    finally:
        cv2.setNumThreads(-1)


def test_views_that_are_not_contiguous():
    left, right = pair(RowOffset(1.0))
    wide = [np.dstack([view, view]) for view in (left, right)]
    assert (find_row_offset(wide[0][..., 0], wide[1][..., 0], 0, 64)
            == find_row_offset(left, right, 0, 64))

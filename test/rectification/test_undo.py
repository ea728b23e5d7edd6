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

"""The warp that undoes a row offset: against its definition, at the border, in bands."""

import cv2
import numpy as np
import pytest

from stereo_refine_ros.rectification import RowOffset, undo_row_offset

pytestmark = pytest.mark.compiled


def smooth(height=240, width=320, seed=0):
    noise = np.random.default_rng(seed).normal(size=(height, width))
    blurred = cv2.GaussianBlur(noise, (0, 0), 4)
    return np.rint(128 + 35 * blurred / blurred.std()).clip(0, 255).astype(np.uint8)


def sampled(image, columns, rows):
    return cv2.remap(image.astype(np.float32), columns.astype(np.float32),
                     rows.astype(np.float32), cv2.INTER_LANCZOS4,
                     borderMode=cv2.BORDER_REPLICATE)


def test_whole_rows_are_moved_as_they_are():
    image = smooth()
    moved = undo_row_offset(image, RowOffset(2.0))
    assert np.array_equal(moved[:-2], image[2:])
    assert np.array_equal(moved[-2:], image[[-1, -1]])
    moved = undo_row_offset(image, RowOffset(-3.0))
    assert np.array_equal(moved[3:], image[:-3])
    assert np.array_equal(moved[:3], image[[0, 0, 0]])


@pytest.mark.parametrize('offset', [
    RowOffset(0.5), RowOffset(-1.3), RowOffset(0.2, stretch_px=1.5), RowOffset(0, 0, 0, 5.0)],
    ids=str)
def test_rows_come_from_where_the_offset_says(offset):
    image = smooth()
    y, x = np.mgrid[:240, :320]
    expected = sampled(image, x, y + offset.at(image.shape))
    moved = undo_row_offset(image, offset).astype(np.float32)
    assert np.abs(moved - expected)[8:-8].max() <= 3
    assert np.abs(moved - expected)[8:-8].mean() <= 0.4


@pytest.mark.parametrize('degrees', [0.2, -0.2, 0.5, -1.0])
def test_clear_tilt_is_undone_as_a_turn(degrees):
    image = smooth()
    matrix = cv2.getRotationMatrix2D((159.5, 119.5), degrees, 1)
    turned = cv2.warpAffine(image, matrix, (320, 240), flags=cv2.INTER_LANCZOS4)
    back = undo_row_offset(turned, RowOffset(tilt_px=-np.sin(np.radians(degrees)) * 319))
    error = np.abs(back.astype(int) - image)[12:-12, 12:-12]
    assert error.mean() <= 1.0
    assert np.abs(turned.astype(int) - image)[12:-12, 12:-12].mean() >= 3 * error.mean()


def test_slight_tilt_moves_no_column():
    """0.05 degrees have other causes than a turned camera."""
    ramp = np.tile(np.arange(0, 240, 0.75).astype(np.uint8), (240, 1))
    moved = undo_row_offset(ramp, RowOffset(tilt_px=np.radians(0.05) * 319))
    assert np.array_equal(moved, ramp)


def test_nothing_to_undo_is_the_same_array():
    image = smooth()
    assert undo_row_offset(image, RowOffset()) is image


@pytest.mark.parametrize('offset', [RowOffset(0.5), RowOffset(0.3, 2.2, 0.7, 1.0)], ids=str)
def test_colours_and_threads_make_no_difference(offset):
    image = np.dstack([smooth(seed=seed) for seed in range(3)])
    moved = undo_row_offset(image, offset)
    assert np.array_equal(undo_row_offset(image, offset, threads=3), moved)
    for channel in range(3):
        alone = undo_row_offset(image[..., channel], offset)
        assert np.array_equal(alone, moved[..., channel])


@pytest.mark.parametrize('shape', [(1, 1), (1, 40), (40, 1), (3, 5), (2, 2, 3)])
@pytest.mark.parametrize('offset', [RowOffset(9.0), RowOffset(-0.5, 3.0, 2.0, 1.0)], ids=str)
def test_small_images(shape, offset):
    image = np.full(shape, 77, np.uint8)
    assert np.array_equal(undo_row_offset(image, offset), image)


def test_bright_edges_do_not_wrap_around():
    image = np.zeros((40, 40), np.uint8)
    image[20:] = 255
    moved = undo_row_offset(image, RowOffset(0.5))
    assert set(np.unique(moved[:17])) == {0}
    assert set(np.unique(moved[23:])) == {255}
    assert np.all(np.diff(moved[18:21].astype(int), axis=0) >= 0)

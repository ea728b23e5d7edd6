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

"""
Averaging rows before the work and restoring them after it.

Disparity runs along rows: half the rows are half the work, and every disparity stays as precise
as it was. Restored rows take the value of the averaged pixel nearest in colour, so that edges
come back at full resolution.
"""

from __future__ import annotations

import math

import cv2
from numba import njit
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.params import ProcessingParams
from stereo_refine_ros.threads import run_bands
from stereo_refine_ros.types import FloatMap, Image, PlaneSegmentation, StereoPair

# What a pixel costs besides its disparities, in disparities: fewer of them save little else.
_PIXEL_CELLS = 32
# Rows that differ by less than this lie on one surface: interpolate between them, in pixels.
_SAME_SURFACE = 1.0
# Grey levels (summed over three channels) that a step away in rows or columns weighs.
_ROW_WEIGHT, _COLUMN_WEIGHT = 10.0, 8.0


def rows_per_bin(shape: tuple[int, int], num_disparities: int, params: ProcessingParams) -> int:
    """Return how many rows to average into one: for `max_cells`, but not below `min_rows`."""
    cells = shape[0] * shape[1] * (num_disparities + _PIXEL_CELLS) / 1e6
    return min(math.ceil(cells / params.max_cells), max(1, shape[0] // params.min_rows))


def bin_rows(pair: StereoPair, rows: int) -> StereoPair:
    """Average `rows` rows into one; the last row repeats where they do not divide the height."""
    if rows == 1:
        return pair
    return StereoPair(_bin_image(pair.left, rows),
                      None if pair.right is None else _bin_image(pair.right, rows))


def bin_disparities(values: FloatMap, rows: int) -> FloatMap:
    """Take of every `rows` rows the middle one, or where that is NaN the first valid one."""
    if rows == 1:
        return values
    padded = cv2.copyMakeBorder(values, 0, -len(values) % rows, 0, 0, cv2.BORDER_REPLICATE)
    binned = padded[rows // 2::rows].copy()
    for row in range(rows):
        binned = np.where(np.isnan(binned), padded[row::rows], binned)
    return binned


def repeat_rows(values: FloatMap, height: int, rows: int) -> FloatMap:
    """Repeat every row, as a map that was not refined is shown at full size."""
    return values if rows == 1 else np.repeat(values, rows, axis=0)[:height]


def restore_rows(values: FloatMap, segments: PlaneSegmentation, binned: Image, image: Image,
                 rows: int, threads: int = 1) -> tuple[FloatMap, PlaneSegmentation]:
    """
    Bring a refined map and its segments back to the rows of the image.

    Parameters
    ----------
    values : float32 ndarray of shape (h, W)
        The refined map, pixels.
    segments : PlaneSegmentation
        Of the binned image.
    binned, image : uint8 ndarray of shape (h, W[, 3]) and (H, W[, 3])
        The left view, binned and as it came.
    rows : int
        Rows of the image in one of the map.
    threads : int
        At most.

    """
    if rows == 1:
        return values, segments
    height, width = image.shape[:2]
    restored = np.empty((height, width), np.float32)
    labels = np.empty((height, width), np.int32)
    run_bands(_restore_kernel, height, threads, values, segments.labels,
              binned.reshape(len(binned), width, -1), image.reshape(height, width, -1), rows,
              restored, labels)
    return restored, PlaneSegmentation(
        labels, _planes_of_rows(segments.planes, rows), segments.is_fitted, segments.inlier_ratio,
        segments.plane_index)


def keep_agreeing(restored: FloatMap, preliminary: FloatMap) -> FloatMap:
    """Take back what a map had at full size wherever the restored map agrees."""
    agrees = np.abs(restored - preliminary) <= _SAME_SURFACE
    return np.where(agrees, preliminary, restored)


def _bin_image(image: Image, rows: int) -> Image:
    binned = np.empty((-(-len(image) // rows), *image.shape[1:]), np.uint8)
    _average_kernel(image.reshape(len(image), -1), rows, binned.reshape(len(binned), -1))
    return binned


def _planes_of_rows(planes: NDArray[np.float64], rows: int) -> NDArray[np.float64]:
    """Binned row v stands for row y with v = (y + 0.5) / rows - 0.5."""
    a, b, c = planes.T
    return np.stack([a, b / rows, c + b * (0.5 / rows - 0.5)], axis=1)


@njit(cache=True, nogil=True, error_model='numpy')
def _average_kernel(image, rows, averaged):
    """Average rows, rounded half to even; OpenCV's area averaging takes five times as long."""
    height, width = image.shape
    total = np.empty(width, np.int32)
    for row in range(averaged.shape[0]):
        total[:] = 0
        for y in range(row * rows, (row + 1) * rows):
            total += image[min(y, height - 1)]
        for i in range(width):
            averaged[row, i] = np.uint8(np.rint(np.float32(total[i]) / np.float32(rows)))


@njit(cache=True, nogil=True)
def _restore_kernel(start, stop, values, labels, binned, image, rows, restored, restored_labels):
    height, width, _ = binned.shape
    is_smooth = np.empty(width, np.bool_)
    for y in range(start, stop):
        v = (y + np.float32(0.5)) / rows - np.float32(0.5)
        upper = min(max(int(np.floor(v)), 0), height - 1)
        lower = min(upper + 1, height - 1)
        part = min(max(v - upper, np.float32(0)), np.float32(1))
        nearest = lower if part > np.float32(0.5) else upper
        restored_labels[y] = labels[nearest]
        _interpolate(values[upper], values[lower], values[nearest], part, restored[y], is_smooth)
        for x in range(width):
            if is_smooth[x]:
                continue
            left, right = max(x - 1, 0), min(x + 1, width - 1)
            row, column = _most_alike(image[y, x], binned, upper, lower, left, x, right, part)
            restored_labels[y, x] = labels[row, column]
            if column != x or not abs(values[upper, x] - values[lower, x]) <= _SAME_SURFACE:
                restored[y, x] = values[row, column]


@njit(cache=True, nogil=True)
def _interpolate(above, below, nearest, part, between, is_smooth):
    """Set what lies between two rows, and where neither they nor the columns have a step."""
    width = above.shape[0]
    for x in range(width):
        between[x] = above[x] + part * (below[x] - above[x])
        is_smooth[x] = abs(above[x] - below[x]) <= _SAME_SURFACE
    for x in range(1, width - 1):
        is_smooth[x] &= abs(nearest[x - 1] - nearest[x + 1]) <= _SAME_SURFACE
    for x in (0, width - 1):
        step = nearest[max(x - 1, 0)] - nearest[min(x + 1, width - 1)]
        is_smooth[x] &= abs(step) <= _SAME_SURFACE


@njit(cache=True, nogil=True)
def _most_alike(color, binned, upper, lower, left, x, right, part):
    """Return the row and column of the binned neighbour nearest in colour and place."""
    least = np.float32(1e9)
    best = (upper, x)
    for side in range(2):
        row = lower if side else upper
        away = (1 - part) if side else part
        for column in range(left, right + 1):
            change = np.int32(0)
            for c in range(color.shape[0]):
                change += abs(np.int32(color[c]) - np.int32(binned[row, column, c]))
            unlike = (np.float32(change * 3 // color.shape[0]) + np.float32(_ROW_WEIGHT) * away
                      + np.float32(_COLUMN_WEIGHT) * abs(column - x))
            if unlike < least:
                least = unlike
                best = (row, column)
    return best

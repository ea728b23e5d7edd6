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

import cv2
from numba import njit
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.threads import run_bands
from stereo_refine_ros.types import FloatMap, Image, PlaneSegmentation, StereoPair

# Rows that differ by less than this lie on one surface: interpolate between them, in pixels.
_SAME_SURFACE = 1.0
# Grey levels (summed over three channels) that a step away in rows or columns weighs.
_ROW_WEIGHT, _COLUMN_WEIGHT = 10.0, 8.0


def rows_per_bin(height: int, max_rows: int) -> int:
    """Return how many rows are averaged into one so that at most `max_rows` are left."""
    return -(-height // max_rows)


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
    segments : PlaneSegmentation
        Of the binned image.
    binned, image : uint8 ndarray of shape (h, W[, 3]) and (H, W[, 3])

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
        labels, _planes_of_rows(segments.planes, rows), segments.is_fitted, segments.inlier_ratio)


def _bin_image(image: Image, rows: int) -> Image:
    padded = cv2.copyMakeBorder(image, 0, -len(image) % rows, 0, 0, cv2.BORDER_REPLICATE)
    size = (padded.shape[1], padded.shape[0] // rows)
    return cv2.resize(padded, size, interpolation=cv2.INTER_AREA)


def _planes_of_rows(planes: NDArray[np.float64], rows: int) -> NDArray[np.float64]:
    """Binned row v stands for row y with v = (y + 0.5) / rows - 0.5."""
    a, b, c = planes.T
    return np.stack([a, b / rows, c + b * (0.5 / rows - 0.5)], axis=1)


@njit(cache=True, nogil=True)
def _restore_kernel(start, stop, values, labels, binned, image, rows, restored, restored_labels):
    height, width, channels = binned.shape
    for y in range(start, stop):
        v = (y + np.float32(0.5)) / rows - np.float32(0.5)
        upper = min(max(int(np.floor(v)), 0), height - 1)
        lower = min(upper + 1, height - 1)
        part = min(max(v - upper, np.float32(0)), np.float32(1))
        for x in range(width):
            least = np.float32(1e9)
            row, column = upper, x
            for candidate in range(2):
                cv = lower if candidate else upper
                away = (1 - part) if candidate else part
                for cx in range(max(x - 1, 0), min(x + 2, width)):
                    change = np.int32(0)
                    for c in range(channels):
                        change += abs(np.int32(image[y, x, c]) - np.int32(binned[cv, cx, c]))
                    unlike = (np.float32(change * 3 // channels)
                              + np.float32(_ROW_WEIGHT) * away
                              + np.float32(_COLUMN_WEIGHT) * abs(cx - x))
                    if unlike < least:
                        least = unlike
                        row, column = cv, cx
            value = values[row, column]
            above, below = values[upper, column], values[lower, column]
            if abs(above - below) <= _SAME_SURFACE:
                value = above + part * (below - above)
            restored[y, x] = value
            restored_labels[y, x] = labels[row, column]

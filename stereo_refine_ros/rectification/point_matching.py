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

"""Points of the left view found in the right one, to a fraction of a row."""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import Any

import cv2
from numba import njit
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.rectification import tuning
from stereo_refine_ros.types import FloatMap, Image


Array = NDArray[np.float64]
_BLOCK = 2 * tuning.COARSE_RADIUS_PX + 1
_SIDE = 2 * tuning.FINE_RADIUS_PX
# Grey levels squared, far below any noise: keeps a plain block from dividing by 0.
_LEAST_VARIANCE = 1e-3


@dataclass(frozen=True, eq=False)
class PointMatches:
    """
    Points seen in both views; image pixels.

    Attributes
    ----------
    x, y : float64 ndarray of shape (N,)
        Where the point lies in the right view, but for its row offset.
    dy : float64 ndarray of shape (N,)
        Row in the right view less row in the left.
    sigma : float64 ndarray of shape (N,)
        Standard deviation of `dy` that the texture around the point promises.

    """

    x: Array
    y: Array
    dy: Array
    sigma: Array


def match_points(left: Image, right: Image, min_disparity: int, num_disparities: int
                 ) -> PointMatches:
    """
    Match the best corner of each cell of the left view.

    Parameters
    ----------
    left, right : uint8 ndarray of shape (H, W)
        Grey.
    min_disparity, num_disparities : int
        Pixels; where along the row a point may be.

    Returns
    -------
    PointMatches
        Empty where the views are too small or too plain.

    """
    levels: list[tuple[Any, Any]] = [(left, right)]
    while levels[-1][0].shape[1] > tuning.COARSE_WIDTH_PX:
        levels.append((_halve(levels[-1][0]), _halve(levels[-1][1])))
    coarse, other = (np.asarray(view, np.float32) for view in levels[-1])
    if min(coarse.shape) < 4 * (tuning.COARSE_RADIUS_PX + tuning.COARSE_ROWS_PX):
        return PointMatches(*np.zeros((4, 0)))
    scale = 2 ** (len(levels) - 1)
    points = _strongest(_cornerness(coarse), tuning.CELLS_ACROSS, tuning.CELLS_DOWN,
                        tuning.COARSE_RADIUS_PX + tuning.COARSE_ROWS_PX + 1)
    found = np.empty((len(points), 5))
    _search(coarse, other, _inverse_deviation(other), points,
            math.floor(min_disparity / scale) - 1,
            math.ceil((min_disparity + num_disparities) / scale) + 1, found)
    found = found[found[:, 4] >= tuning.COARSE_CORRELATION]
    return _refine(levels, found)


def _refine(levels: list[tuple[Any, Any]], found: Array) -> PointMatches:
    """Follow points that were found at the last level to the first, by way of the second."""
    level = len(levels) - 1
    for finer in range(min(level, 1), -1, -1):
        tracked = np.empty((len(found), 6))
        _track(*levels[finer], found, 2.0 ** (level - finer), tracked)
        found = tracked[tracked[:, 4] >= tuning.FINE_CORRELATION]
        level = finer
    x, y, disparity, dy, _, sigma = found.T
    return PointMatches(x - disparity, y, dy, sigma)


def _cornerness(image: FloatMap) -> FloatMap:
    return np.asarray(cv2.cornerMinEigenVal(image, 2 * tuning.COARSE_RADIUS_PX - 1, ksize=3))


@njit(cache=True, nogil=True)
def _halve(image):
    height, width = image.shape[0] // 2, image.shape[1] // 2
    out = np.empty((height, width), np.float32)
    for y in range(height):
        upper, lower = image[2 * y], image[2 * y + 1]
        for x in range(width):
            out[y, x] = np.float32(0.25) * (
                np.float32(upper[2 * x]) + np.float32(upper[2 * x + 1])
                + np.float32(lower[2 * x]) + np.float32(lower[2 * x + 1]))
    return out


@njit(cache=True, nogil=True)
def _strongest(score, across, down, margin):
    """Return the pixel of highest score of each cell: int64 (N, 2), columns x, y."""
    height, width = score.shape[0] - 2 * margin, score.shape[1] - 2 * margin
    points = np.empty((across * down, 2), np.int64)
    count = 0
    for j in range(down):
        for i in range(across):
            best = np.float32(0)
            for y in range(margin + height * j // down, margin + height * (j + 1) // down):
                for x in range(margin + width * i // across, margin + width * (i + 1) // across):
                    if score[y, x] > best:
                        best = score[y, x]
                        points[count] = x, y
            if best > 0:
                count += 1
    return points[:count]


def _inverse_deviation(image: FloatMap) -> FloatMap:
    """Return 1 / the root of the summed squared deviations of each pixel's block."""
    size = (_BLOCK, _BLOCK)
    mean = cv2.boxFilter(image, cv2.CV_64F, size)
    variance = cv2.sqrBoxFilter(image, cv2.CV_64F, size) - mean * mean
    return (1 / np.sqrt(_BLOCK ** 2 * np.maximum(variance, _LEAST_VARIANCE))).astype(np.float32)


@njit(cache=True, nogil=True)
def _search(left, right, inverse, points, low, high, found):
    """Search each point along the row and a little above and below, by correlation."""
    radius, rows = tuning.COARSE_RADIUS_PX, tuning.COARSE_ROWS_PX
    width = right.shape[1]
    cross = np.empty(width, np.float32)
    for n in range(len(points)):
        x, y = points[n]
        block = left[y - radius:y + radius + 1, x - radius:x + radius + 1]
        block = block - block.mean()
        block /= np.float32(math.sqrt((block * block).sum()))
        first = max(radius, x - high)
        size = min(width - 1 - radius, x - low) - first + 1
        best, best_d, best_dy = np.float32(-1), 0, 0
        for dy in range(-rows, rows + 1):
            cross[:max(size, 0)] = 0
            for j in range(_BLOCK):
                for i in range(_BLOCK):
                    value = block[j, i]
                    line = right[y + dy + j - radius, first + i - radius:]
                    for k in range(size):
                        cross[k] += value * line[k]
            line = inverse[y + dy, first:]
            for k in range(size):
                correlation = cross[k] * line[k]
                if correlation > best:
                    best, best_d, best_dy = correlation, x - first - k, dy
        found[n, 0], found[n, 1], found[n, 2], found[n, 3], found[n, 4] = (
            x, y, best_d, best_dy, best)


@njit(cache=True, nogil=True)
def _track(left, right, found, factor, out):
    """Refine disparity and row by Gauss-Newton steps on a block (Lucas-Kanade, gain free)."""
    height, width = left.shape
    blocks = np.empty((3, _SIDE, _SIDE), np.float32)
    block, gx, gy = blocks[0], blocks[1], blocks[2]
    for n in range(len(found)):
        # The corner in the middle of a coarse pixel lies between the pixels of the finer level.
        x = int(factor * (found[n, 0] + 0.5)) - _SIDE // 2
        y = int(factor * (found[n, 1] + 0.5)) - _SIDE // 2
        begin_u, begin_v = -factor * found[n, 2], factor * found[n, 3]
        u, v, noise, correlation = begin_u, begin_v, 0.0, -1.0
        out[n, 0], out[n, 1] = x + _SIDE // 2, y + _SIDE // 2
        is_inside = 0 < x < width - 1 - _SIDE and 0 < y < height - 1 - _SIDE
        if is_inside:
            energy, xx, xy, yy, bx, by = _cut(left, x, y, block, gx, gy)
            determinant = xx * yy - xy * xy
            for _ in range(tuning.FINE_STEPS):
                column, row = int(math.floor(x + u)), int(math.floor(y + v))
                is_inside = (0 <= column < width - _SIDE and 0 <= row < height - _SIDE
                             and max(abs(u - begin_u), abs(v - begin_v)) <= tuning.FINE_REACH_PX
                             and determinant > 1e-6 * xx * yy)
                if not is_inside:
                    correlation = -1.0
                    break
                other, cross, cross_x, cross_y = _compare(
                    right, column, row, x + u - column, y + v - row, block, gx, gy)
                correlation = cross / math.sqrt(max(energy * other, 1e-6))
                gain = math.sqrt(energy / max(other, 1e-6))
                rx, ry = bx - gain * cross_x, by - gain * cross_y
                step_u = (yy * rx - xy * ry) / determinant
                step_v = (xx * ry - xy * rx) / determinant
                u += step_u
                v += step_v
                if abs(step_u) + abs(step_v) < tuning.FINE_STEP_PX:
                    break
            noise = 2 * max(1 - correlation, 0.0) * energy / _SIDE ** 2
        out[n, 2], out[n, 3], out[n, 4] = -u, v, correlation
        out[n, 5] = math.sqrt(noise * xx / determinant) if correlation > 0 else np.inf


@njit(cache=True, nogil=True, fastmath={'reassoc', 'contract'})
def _cut(image, left, top, block, gx, gy):
    """Cut out a block and its gradients, all of mean 0; return their sums of products."""
    half = np.float32(0.5)
    mean = mean_x = mean_y = np.float32(0)
    for j in range(_SIDE):
        above = image[top + j - 1, left:left + _SIDE]
        here = image[top + j, left - 1:left + _SIDE + 1]
        below = image[top + j + 1, left:left + _SIDE]
        for i in range(_SIDE):
            block[j, i] = here[i + 1]
            gx[j, i] = half * (np.float32(here[i + 2]) - np.float32(here[i]))
            gy[j, i] = half * (np.float32(below[i]) - np.float32(above[i]))
            mean += block[j, i]
            mean_x += gx[j, i]
            mean_y += gy[j, i]
    area = np.float32(_SIDE * _SIDE)
    mean, mean_x, mean_y = mean / area, mean_x / area, mean_y / area
    energy = xx = xy = yy = bx = by = np.float32(0)
    for j in range(_SIDE):
        for i in range(_SIDE):
            block[j, i] -= mean
            gx[j, i] -= mean_x
            gy[j, i] -= mean_y
            energy += block[j, i] * block[j, i]
            xx += gx[j, i] * gx[j, i]
            xy += gx[j, i] * gy[j, i]
            yy += gy[j, i] * gy[j, i]
            bx += gx[j, i] * block[j, i]
            by += gy[j, i] * block[j, i]
    return float(energy), float(xx), float(xy), float(yy), float(bx), float(by)


@njit(cache=True, nogil=True, fastmath={'reassoc', 'contract'})
def _compare(image, left, top, part_x, part_y, block, gx, gy):
    """Interpolate the other view's block; return its energy and its products with the first's."""
    ax, ay = np.float32(part_x), np.float32(part_y)
    bx, by = np.float32(1) - ax, np.float32(1) - ay
    total = square = cross = cross_x = cross_y = np.float32(0)
    # Levels are counted from one of the block, so that float32 keeps the variance.
    base = np.float32(image[top + _SIDE // 2, left + _SIDE // 2])
    for j in range(_SIDE):
        upper = image[top + j, left:left + _SIDE + 1]
        lower = image[top + j + 1, left:left + _SIDE + 1]
        level, slope_x, slope_y = block[j], gx[j], gy[j]
        for i in range(_SIDE):
            value = (by * (bx * np.float32(upper[i]) + ax * np.float32(upper[i + 1]))
                     + ay * (bx * np.float32(lower[i]) + ax * np.float32(lower[i + 1]))) - base
            total += value
            square += value * value
            cross += level[i] * value
            cross_x += slope_x[i] * value
            cross_y += slope_y[i] * value
    energy = square - total * total / np.float32(_SIDE * _SIDE)
    return float(energy), float(cross), float(cross_x), float(cross_y)

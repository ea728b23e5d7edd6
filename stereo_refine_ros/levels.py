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
Two resolutions around the stages, none of which knows of them.

Planes and choices are made on a grid: the image itself, or its half where it is large. The map
that comes out of the choice goes back to full size, where what was given and stood keeps its
every pixel.
"""

from __future__ import annotations

from dataclasses import dataclass

from numba import njit
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.graph.tuning import SMOOTH_STEP
from stereo_refine_ros.images import doubled, halve
from stereo_refine_ros.threads import run_bands
from stereo_refine_ros.types import FloatMap, Image, PlaneSegmentation, StereoPair


def grid_scale(shape: tuple[int, int], megapixels: float) -> int:
    """Return 1 for images of up to so many million pixels, else 2: the grid is half as fine."""
    return 1 if shape[0] * shape[1] <= megapixels * 1e6 else 2


def halve_pair(pair: StereoPair) -> StereoPair:
    """Halve both views."""
    return StereoPair(halve(pair.left), None if pair.right is None else halve(pair.right))


def to_grid(values: FloatMap, scale: int, threads: int = 1) -> FloatMap:
    """
    Bring a full-size map to the grid; its disparities stay in full-size pixels.

    A pixel of a half-size grid is the mean of those of its four that lie within 1 px of the first
    valid one; NaN where none is valid.
    """
    if scale == 1:
        return values
    height, width = values.shape
    half = np.empty(((height + 1) // 2, (width + 1) // 2), np.float32)
    run_bands(_pick_kernel, len(half), threads, np.ascontiguousarray(values), half)
    return half


def repeated(values: np.ndarray, shape: tuple[int, int], scale: int) -> np.ndarray:
    """Give every full-size pixel what its pixel of the grid has; int32 or float32."""
    return values if scale == 1 else doubled(values, shape)


def segments_at_full_size(segments: PlaneSegmentation, shape: tuple[int, int], scale: int,
                          ) -> PlaneSegmentation:
    """Return segments of full-size pixels, and planes in their coordinates."""
    if scale == 1:
        return segments
    # Pixel x of the grid stands for 2 x + 0.5 of the image.
    a, b, c = segments.planes.T
    planes = np.stack([a / 2, b / 2, c - (a + b) / 4], axis=1)
    labels = np.ascontiguousarray(repeated(segments.labels, shape, scale))
    return PlaneSegmentation(labels, planes, segments.is_fitted, segments.inlier_ratio,
                             segments.plane_index)


@dataclass(frozen=True, eq=False)
class Choice:
    """
    A map on the grid.

    Attributes
    ----------
    given, values : float32 ndarray of shape (H, W)
        What was given there, and what stands there now.
    is_moved : bool ndarray of shape (H, W)
        Where that is another.
    is_literal : bool
        Whether holes that were not moved stay holes, and all that was moved moves.
    rounding : float
        By how many pixels what was given had been rounded: what stands takes `values` within it.

    """

    given: FloatMap
    values: FloatMap
    is_moved: NDArray[np.bool_]
    is_literal: bool = False
    rounding: float = 0.0


def unround(rounded: FloatMap, finer: FloatMap, rounding: float, where: NDArray[np.bool_],
            threads: int = 1) -> FloatMap:
    """
    Put right by a finer map what was rounded.

    A whole disparity stands for all that round to it: among them it becomes the one nearest to
    `finer`, where that is no further than the next whole disparity.
    """
    out = rounded.copy()
    run_bands(_unround_kernel, len(out), threads, finer, np.float32(rounding), where, out)
    return out


def at_full_size(choice: Choice, given: FloatMap, left: Image, grid_left: Image,
                 scale: int, threads: int = 1) -> FloatMap:
    """
    Bring what was chosen on the grid to full size.

    A given pixel that stood, or that lies on another surface than the one that was moved, keeps
    its disparity, or what it was rounded from. Elsewhere the grid's map is interpolated, at its
    steps by likeness of colour.

    Returns
    -------
    float32 ndarray of shape (H, W)

    """
    if scale == 1:
        return choice.values.copy()
    height, width = given.shape
    channels = 1 if left.ndim == 2 else 3
    out = np.empty_like(given)
    run_bands(_restore_kernel, height, threads, choice.given, choice.values, choice.is_moved,
              np.ascontiguousarray(given), left.reshape(height, width, channels),
              grid_left.reshape(*choice.values.shape, channels), choice.is_literal,
              np.float32(SMOOTH_STEP), np.float32(choice.rounding), out)
    return out


@njit(cache=True, nogil=True, error_model='numpy')
def _pick_kernel(start, stop, values, half):
    height, width = values.shape
    none = np.float32(np.nan)
    whole = width // 2
    for y in range(start, stop):
        upper, lower, to = values[2 * y], values[min(2 * y + 1, height - 1)], half[y]
        if 2 * y + 1 < height:
            for x in range(whole):
                to[x] = _mean(upper[2 * x], upper[2 * x + 1], lower[2 * x], lower[2 * x + 1])
        else:
            for x in range(whole):
                to[x] = _mean(upper[2 * x], upper[2 * x + 1], none, none)
        if width % 2:
            below = lower[width - 1] if 2 * y + 1 < height else none
            to[whole] = _mean(upper[width - 1], none, below, none)


@njit(cache=True, nogil=True, error_model='numpy', inline='always')
def _mean(a, b, c, d):
    """Mean of those within 1 px of the first that is not NaN; no branches, for vectors."""
    first = c if c == c else d
    first = b if b == b else first
    first = a if a == a else first
    one, none = np.float32(1), np.float32(0)
    near_a, near_b = abs(a - first) <= one, abs(b - first) <= one
    near_c, near_d = abs(c - first) <= one, abs(d - first) <= one
    total = ((a if near_a else none) + (b if near_b else none)
             + (c if near_c else none) + (d if near_d else none))
    count = ((one if near_a else none) + (one if near_b else none)
             + (one if near_c else none) + (one if near_d else none))
    return total / max(count, one) if count > 0 else np.float32(np.nan)


@njit(cache=True, nogil=True)
def _unround_kernel(start, stop, finer, rounding, where, values):
    for y in range(start, stop):
        for x in range(values.shape[1]):
            if where[y, x]:
                values[y, x] = _unrounded(values[y, x], finer[y, x], rounding)


@njit(cache=True, nogil=True, inline='always')
def _unrounded(value, finer, rounding):
    """Return what rounds to a value and is nearest to a finer one, if that is near at all."""
    if abs(finer - value) <= 2 * rounding:
        return min(max(finer, value - rounding), value + rounding)
    return value


@njit(cache=True, nogil=True)
def _restore_kernel(start, stop, grid_given, grid, is_moved, given, left, grid_left, is_literal,
                    smooth, rounding, out):
    height, width = grid.shape
    blend, most, least = np.empty((3, width + 2), np.float32)
    between, span = np.empty((2, 2 * width), np.float32)
    for y in range(start, stop):
        gy = y >> 1
        above, below = max((y - 1) >> 1, 0), min(((y - 1) >> 1) + 1, height - 1)
        _blend_rows(grid[above], grid[below], np.float32(0.25 if y & 1 else 0.75), blend, most,
                    least)
        _double_columns(blend, most, least, between, span)
        moved, chosen, before = is_moved[gy], grid[gy], grid_given[gy]
        row, to = given[y], out[y]
        for x in range(row.shape[0]):
            value, gx = row[x], x >> 1
            if is_literal:
                stands = not moved[gx]
            else:
                stands = not np.isnan(value) and (
                    not moved[gx] or abs(value - chosen[gx]) <= 1
                    or not abs(value - before[gx]) <= 1)
            is_smooth = span[x] <= smooth
            if stands:
                to[x] = _unrounded(value, between[x], rounding) if is_smooth else value
            elif is_smooth:
                to[x] = between[x]
            else:
                to[x] = _most_alike(y, x, above, below, grid, left, grid_left)


@njit(cache=True, nogil=True)
def _blend_rows(above, below, down, blend, most, least):
    """Blend two rows of the grid and note their larger and smaller values; one more each side."""
    width = above.shape[0]
    for x in range(width):
        blend[x + 1] = above[x] * (np.float32(1) - down) + below[x] * down
        most[x + 1], least[x + 1] = max(above[x], below[x]), min(above[x], below[x])
    for row in (blend, most, least):
        row[0], row[width + 1] = row[1], row[width]


@njit(cache=True, nogil=True)
def _double_columns(blend, most, least, between, span):
    """Interpolate between the columns of the grid; the span of the four values around."""
    near, far = np.float32(0.75), np.float32(0.25)
    for x in range(between.shape[0] // 2):
        a, b, c = blend[x], blend[x + 1], blend[x + 2]
        between[2 * x], between[2 * x + 1] = far * a + near * b, near * b + far * c
        span[2 * x] = max(most[x], most[x + 1]) - min(least[x], least[x + 1])
        span[2 * x + 1] = max(most[x + 1], most[x + 2]) - min(least[x + 1], least[x + 2])


@njit(cache=True, nogil=True, inline='always')
def _most_alike(y, x, above, below, grid, left, grid_left):
    """Return what the one of four pixels of the grid has that is most alike in colour."""
    width, channels = grid.shape[1], left.shape[2]
    before, after = max((x - 1) >> 1, 0), min(((x - 1) >> 1) + 1, width - 1)
    best, least = np.float32(0), np.int32(1 << 30)
    parts = np.int32(3 // channels)  # grey counts as three equal channels
    for k in range(4):
        gy, gx = below if k & 2 else above, after if k & 1 else before
        # Of two that are equally alike, the nearer.
        change = np.int32(0 if gy == y >> 1 else 5) + np.int32(0 if gx == x >> 1 else 5)
        for i in range(channels):
            change += parts * abs(np.int32(left[y, x, i]) - np.int32(grid_left[gy, gx, i]))
        if change < least:
            best, least = grid[gy, gx], change
    return best

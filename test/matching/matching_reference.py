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

"""Slow, obvious versions of the matching kernels, on lists and dictionaries."""

from __future__ import annotations

import numpy as np


def truncated_cost(left, right, min_disparity, num_disparities, is_left):
    """Compute the cost volume of one view pixel by pixel, in float64."""
    base, other, sign = (left, right, -1) if is_left else (right, left, 1)
    height, width = base.shape[:2]
    volume = np.full((height, width, num_disparities), np.nan)
    for y in range(height):
        for x in range(width):
            for k in range(num_disparities):
                partner = x + sign * (min_disparity + k)
                if not is_left:
                    partner = min(max(partner, 0), width - 1)
                if 0 <= partner < width:
                    volume[y, x, k] = pixel_cost(base, other, y, x, partner)
    return nearest_of_row(volume) if is_left else volume


def pixel_cost(base, other, y, x, partner):
    """Return 0.11 min(mean |dBGR|, 7) + 0.89 min(|d of the x-gradient|, 2)."""
    colour = np.abs(base[y, x].astype(float) - other[y, partner].astype(float)).mean()
    gradient = abs(x_gradient(base[y], x) - x_gradient(other[y], partner))
    return 0.11 * min(colour, 7.0) + 0.89 * min(gradient, 2.0)


def x_gradient(row, x):
    """Return the central difference of the rounded grey values, the border repeated."""
    if row.ndim == 2:
        grey = np.rint(row.astype(float) @ [0.114, 0.587, 0.299])
    else:
        grey = row.astype(float)
    last = len(grey) - 1
    return 0.5 * (grey[min(x + 1, last)] - grey[max(x - 1, 0)])


def nearest_of_row(volume):
    """Fill NaN from the nearest pixel of the row with a cost, else with the largest cost."""
    filled = volume.copy()
    for y, x, k in np.argwhere(np.isnan(volume)):
        known = np.flatnonzero(np.isfinite(volume[y, :, k]))
        nearest = known[np.abs(known - x).argmin()] if len(known) else None
        filled[y, x, k] = 2.55 if nearest is None else volume[y, nearest, k]
    return filled


def left_right_check(left, right, tolerance):
    """Check one pixel after the other."""
    consistent = np.zeros(left.shape, bool)
    for y, x in np.argwhere(np.isfinite(left)):
        partner = int(np.floor(x - left[y, x] + 0.5))
        if 0 <= partner < left.shape[1]:
            consistent[y, x] = abs(left[y, x] - right[y, partner]) <= tolerance
    return consistent


def remove_speckles(values, size, step):
    """Grow every island pixel by pixel."""
    kept = values.copy()
    open_pixels = set(zip(*np.nonzero(np.isfinite(values)), strict=True))
    while open_pixels:
        island = [open_pixels.pop()]
        for y, x in island:
            for other in ((y - 1, x), (y + 1, x), (y, x - 1), (y, x + 1)):
                if other in open_pixels and abs(values[other] - values[y, x]) <= step:
                    open_pixels.remove(other)
                    island.append(other)
        if len(island) <= size:
            kept[tuple(np.transpose(island))] = np.nan
    return kept

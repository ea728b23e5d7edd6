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

"""Where to look at full size once the views were matched at half size."""

from __future__ import annotations

import cv2
from numba import njit
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.images import doubled
from stereo_refine_ros.matching.tuning import WINDOW, WINDOW_MARGIN
from stereo_refine_ros.types import FloatMap

_AROUND = np.ones((3, 3), np.uint8)


def half_range(min_disparity: int, num_disparities: int) -> tuple[int, int]:
    """Return the first disparity and their number that cover a range at half size."""
    first = min_disparity // 2
    return first, -(-(min_disparity + num_disparities - 1) // 2) - first + 1


def windows(half: FloatMap, shape: tuple[int, int], min_disparity: int,
            num_disparities: int) -> NDArray[np.int32]:
    """
    Lay windows of WINDOW disparities around what was found at half size.

    A window is centred between the least and the greatest disparity of 3x3 half-size pixels, and
    reaches beyond the pixel's own by WINDOW_MARGIN at least. What half size did not match takes
    the farther of its neighbours in the row.

    Parameters
    ----------
    half : float32 ndarray of shape (ceil(H / 2), ceil(W / 2)), half-size pixels
        NaN where there is no match.
    shape : tuple of int
        H and W.
    min_disparity, num_disparities : int, pixels
        The range at full size; at least WINDOW disparities.

    Returns
    -------
    int32 ndarray of shape (H, W)
        First disparity of every pixel's window less `min_disparity`.

    """
    filled = np.empty_like(half)
    _fill_kernel(half, np.float32(min_disparity / 2), filled)
    base = np.empty(half.shape, np.int32)
    _base_kernel(filled, cv2.erode(filled, _AROUND), cv2.dilate(filled, _AROUND), min_disparity,
                 num_disparities - WINDOW, base)
    return np.ascontiguousarray(doubled(base, shape))


@njit(cache=True, nogil=True)
def _base_kernel(own, least, greatest, min_disparity, last, base):
    for y in range(base.shape[0]):
        for x in range(base.shape[1]):
            here = np.int32(np.rint(2 * own[y, x]))
            first = np.int32(np.rint(least[y, x] + greatest[y, x])) - WINDOW // 2
            first = max(first, here + WINDOW_MARGIN - WINDOW)
            first = min(first, here - WINDOW_MARGIN) - min_disparity
            base[y, x] = min(max(first, 0), last)


@njit(cache=True, nogil=True)
def _fill_kernel(values, otherwise, out):
    """Fill NaN from the lesser neighbour of the row; a row without any from the row above."""
    height, width = values.shape
    for y in range(height):
        row, to = values[y], out[y]
        known = np.float32(np.nan)
        for x in range(width):
            known = known if np.isnan(row[x]) else row[x]
            to[x] = known
        known = np.float32(np.nan)
        for x in range(width - 1, -1, -1):
            known = known if np.isnan(row[x]) else row[x]
            if np.isnan(to[x]) or known < to[x]:
                to[x] = known
        if np.isnan(to[0]):
            if y > 0:
                to[:] = out[y - 1]
            else:
                to[:] = otherwise

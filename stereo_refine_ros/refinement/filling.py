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

"""Holes take the disparity of the background: what one view does not see lies behind."""

from __future__ import annotations

from numba import njit
import numpy as np

from stereo_refine_ros.types import FloatMap


def fill_from_background(values: FloatMap) -> FloatMap:
    """
    Fill holes from the nearest valid pixels to the left and right, the smaller of the two.

    What one view does not see belongs to the background, whose disparity is smaller. A hole at
    the image border takes its only neighbour; a row without data takes the nearest row with
    some (the upper one of two). A map without a valid pixel comes back as it is.

    Parameters
    ----------
    values : float32 ndarray of shape (H, W)
        Pixels, NaN invalid; not changed.

    """
    return fill_sides(values)[0]


def fill_sides(values: FloatMap) -> tuple[FloatMap, FloatMap]:
    """
    Fill holes from the side of the background, and from that of the foreground.

    See `fill_from_background`; the second map takes the larger of the two neighbours.
    """
    low, high = np.empty((2, *values.shape), np.float32)
    has_data = np.empty(len(values), np.bool_)
    _fill_kernel(np.require(values, np.float32, ['C', 'W']), low, high, has_data)
    return _fill_rows(low, has_data), _fill_rows(high, has_data)


@njit(cache=True, nogil=True)
def _fill_kernel(values, low, high, has_data):
    height, width = values.shape
    for y in range(height):
        carried = np.float32(np.nan)
        for x in range(width):
            if not np.isnan(values[y, x]):
                carried = values[y, x]
            low[y, x] = high[y, x] = carried
        has_data[y] = not np.isnan(carried)
        carried = np.float32(np.nan)
        for x in range(width - 1, -1, -1):
            if not np.isnan(values[y, x]):
                carried = values[y, x]
            elif np.isnan(low[y, x]):
                low[y, x] = high[y, x] = carried
            else:
                low[y, x] = min(low[y, x], carried) if not np.isnan(carried) else low[y, x]
                high[y, x] = max(high[y, x], carried) if not np.isnan(carried) else high[y, x]


def _fill_rows(values: FloatMap, has_data: np.ndarray) -> FloatMap:
    filled = np.flatnonzero(has_data)
    if filled.size == 0 or filled.size == len(has_data):
        return values
    rows = np.arange(len(has_data))
    nearest = filled[np.argmin(np.abs(rows[:, None] - filled[None, :]), axis=1)]
    return values[nearest]

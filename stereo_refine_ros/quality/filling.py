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

"""The plain baseline for holes: take the background's disparity."""

from __future__ import annotations

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
    holes = np.isnan(values)
    if not holes.any():
        return values.copy()
    from_left = _carry(values, holes)
    from_right = _carry(values[:, ::-1], holes[:, ::-1])[:, ::-1]
    filled = np.where(holes, np.fmin(from_left, from_right), values)
    return _fill_rows(filled, ~np.all(holes, axis=1))


def _carry(values: FloatMap, holes: np.ndarray) -> FloatMap:
    """Carry the last valid value of each row to the right."""
    column = np.where(holes, -1, np.arange(values.shape[1]))
    last = np.maximum.accumulate(column, axis=1)
    # Index -1 stands for "none yet"; its value is a hole of the row or is masked here.
    carried = np.take_along_axis(values, last, axis=1)
    return np.where(last < 0, np.float32(np.nan), carried)


def _fill_rows(values: FloatMap, has_data: np.ndarray) -> FloatMap:
    filled = np.flatnonzero(has_data)
    if filled.size == 0 or filled.size == len(has_data):
        return values
    rows = np.arange(len(has_data))
    nearest = filled[np.argmin(np.abs(rows[:, None] - filled[None, :]), axis=1)]
    return values[nearest]

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

"""How far to believe the columns of two views, from how their rows disagree."""

from __future__ import annotations

import math

from numba import njit
import numpy as np

from stereo_refine_ros.rectification.row_offset import RowOffset
from stereo_refine_ros.threads import run_bands
from stereo_refine_ros.types import FloatMap


def columns_hold(disparity: FloatMap, offset: RowOffset, width: int, scale: int = 1,
                 threads: int = 1) -> FloatMap:
    """
    Return the probability that columns are off by less than a pixel.

    A shift of all rows, or a turn of the camera, says nothing against the columns once it is
    undone. Whatever else bends the rows of a view bends its columns too, and that cannot be seen:
    it looks like disparity. The best guess is an error as large, to either side: normal, with
    what is left of the row offset as its standard deviation.

    Parameters
    ----------
    disparity : float32 ndarray of shape (H, W)
        Pixels of the image, NaN where unknown: it says which pixel of the right view was matched.
    offset : RowOffset
        Of the pair, undone or not.
    width : int
        Columns of the image.
    scale : int
        Pixels of the image per pixel of `disparity`.
    threads : int
        The result does not depend on it.

    Returns
    -------
    float32 ndarray of shape (H, W), 0..1
        1 where `disparity` is unknown.

    """
    hold = np.empty_like(disparity)
    terms = np.array([offset.bend_px(width), offset.stretch_px, offset.twist_px], np.float32)
    if not terms.any():
        hold.fill(1)
        return hold
    run_bands(_hold_kernel, len(disparity), threads, np.ascontiguousarray(disparity), terms,
              np.float32(scale / max(width - 1, 1)), np.float32(1 / max(width - 1, 1)), hold)
    return hold


@njit(cache=True, nogil=True)
def _hold_kernel(start, stop, disparity, terms, column, pixel, hold):
    height, width = disparity.shape
    for y in range(start, stop):
        down = np.float32(y / max(height - 1, 1) - 0.5)
        for x in range(width):
            across = column * x - pixel * disparity[y, x] - np.float32(0.5)
            off = abs(terms[0] * across + terms[1] * down + terms[2] * across * down)
            # Below 0.1 px none is off by a pixel: ten standard deviations.
            hold[y, x] = math.erf(math.sqrt(0.5) / off) if off > 0.1 else np.float32(1)

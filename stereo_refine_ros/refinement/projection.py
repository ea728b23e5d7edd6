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

"""The disparities of planes at the pixels of their segments."""

from __future__ import annotations

from numba import njit
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.refinement.planes import bounded_disparity
from stereo_refine_ros.types import FloatMap, LabelMap


def plane_disparities(labels: LabelMap, planes: NDArray[np.float64], low: float,
                      high: float) -> FloatMap:
    """Evaluate every pixel's plane, limited to low..high; NaN where its segment has none."""
    values = np.empty(labels.shape, np.float32)
    _plane_kernel(labels, planes, low, high, values)
    return values


@njit(cache=True, nogil=True)
def _plane_kernel(labels, planes, low, high, values):
    height, width = labels.shape
    for y in range(height):
        for x in range(width):
            plane = planes[labels[y, x]]
            if np.isnan(plane[0]):
                values[y, x] = np.nan
            else:
                values[y, x] = min(max(bounded_disparity(plane, x, y), low), high)

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

"""What every matcher returns."""

from __future__ import annotations

from dataclasses import dataclass
import math

import numpy as np

from stereo_refine_ros.types import DisparityMap, FloatMap


@dataclass(frozen=True, eq=False)
class Scan:
    """
    What the scanline matcher found in a pair.

    Attributes
    ----------
    disparity : float32 ndarray of shape (H, W)
        Sub-pixel, left view; NaN where both views disagree, or where another disparity fits as
        well, as on a plain wall.
    uniqueness : float32 ndarray of shape (H, W), 0..2
        By how much the winner beats all disparities farther than 2 from it.
    right : float32 ndarray of shape (H, W)
        Disparity that the right view sees at each of its pixels; NaN where no left pixel reaches.

    """

    disparity: FloatMap
    uniqueness: FloatMap
    right: FloatMap


@dataclass(frozen=True, eq=False)
class Match:
    """
    A preliminary disparity, and what its matcher knows beside it.

    Attributes
    ----------
    disparity : DisparityMap
        Left view, sub-pixel, left-right checked: NaN where the check failed or nothing matched.
    subpixel : float32 ndarray of shape (H, W), or None
        Sub-pixel winner-takes-all disparities that passed the left-right check, NaN elsewhere:
        the data that planes are fitted to. None where `disparity` itself is that.
    scan : Scan, or None
        What the scanline matcher found, where it is the matcher.
    is_own : bool
        Whether a matcher here found it, left-right checked; False for a map from outside.

    """

    disparity: DisparityMap
    subpixel: FloatMap | None = None
    scan: Scan | None = None
    is_own: bool = True

    @property
    def fit_data(self) -> FloatMap:
        """Return what planes are fitted to: `subpixel` where there is one, else `disparity`."""
        return self.disparity.values if self.subpixel is None else self.subpixel

    @property
    def rounding(self) -> float:
        """Return by how many pixels `disparity` was rounded: 0.5 where it is whole, else 0."""
        # Row by row: the first one tells of nearly every map that is not whole.
        is_whole = all(np.array_equal(row, np.rint(row), equal_nan=True)
                       for row in self.disparity.values)
        return 0.5 if is_whole else 0.0

    @property
    def lr_consistent_ratio(self) -> float:
        """Share of pixels that passed the left-right check, NaN where nobody made it."""
        if not self.is_own:
            return math.nan
        return float(np.count_nonzero(np.isfinite(self.fit_data))) / self.fit_data.size

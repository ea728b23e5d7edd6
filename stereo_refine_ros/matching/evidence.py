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

"""What the images say for and against a disparity: the scanline-optimised cost volume."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# The paths' sum in `Evidence.total` per unit of cost: four paths in units of 1 / 30.
TOTAL_UNIT = 120.0


@dataclass(frozen=True, eq=False)
class Evidence:
    """
    Optimised costs of the left view and the winners of the right view.

    Attributes
    ----------
    total : int16 ndarray of shape (H, W, P)
        Sum over the paths, TOTAL_UNIT to one unit of cost; the last axis is d - min_disparity.
        P is num_disparities rounded up; the rest is padding.
    least : int16 ndarray of shape (H, W)
        The least entry of every pixel of `total`.
    cost : uint8 ndarray of shape (H, W, P)
        The matching cost itself, COST_UNIT to one unit.
    right : int16 ndarray of shape (H, W)
        Best disparity of the right view less min_disparity; -1 where no left pixel reaches.
    min_disparity, num_disparities : int
        Of the volume.

    """

    total: NDArray[np.int16]
    least: NDArray[np.int16]
    cost: NDArray[np.uint8]
    right: NDArray[np.int16]
    min_disparity: int
    num_disparities: int

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

"""One stereo pair and everything that is known about it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.types import FloatMap, StereoGeometry, StereoPair

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Scene:
    """
    A stereo pair with its ground truth, evaluation regions and geometry.

    Attributes
    ----------
    name : str
    pair : StereoPair
        Left and right view, uint8 (H, W, 3) BGR or (H, W).
    truth : float32 ndarray of shape (H, W), or None
        Disparity of the left view in pixels, NaN where unknown.
    scale : float
        Grey levels per pixel of disparity in the data set's own 8-bit maps; 1 where its maps
        are not of 8 bits.
    num_disparities : int or None
        Size of the search range [0, num_disparities) that the data set names.
    masks : mapping of str to bool ndarray of shape (H, W)
        Evaluation regions: `all` with any truth, `nonocc` and `disc` where known.
    geometry : StereoGeometry or None
    truth_right : float32 ndarray of shape (H, W), or None
        Disparity of the right view (x in the right view is x + d in the left), NaN unknown.

    """

    name: str
    pair: StereoPair
    truth: FloatMap | None = None
    scale: float = 1.0
    num_disparities: int | None = None
    masks: Mapping[str, Mask] = field(default_factory=dict)
    geometry: StereoGeometry | None = None
    truth_right: FloatMap | None = None


def visible_in_both(truth: FloatMap, truth_right: FloatMap) -> Mask:
    """
    Mark the left pixels whose disparity the right map confirms within one pixel.

    Parameters
    ----------
    truth, truth_right : float32 ndarray of shape (H, W)
        Pixels, NaN unknown.

    Returns
    -------
    bool ndarray of shape (H, W)

    """
    height, width = truth.shape
    known = np.isfinite(truth)
    columns = np.arange(width) - np.where(known, truth, 0.0)
    target = np.rint(columns).astype(np.int64)
    inside = known & (target >= 0) & (target < width)
    rows = np.broadcast_to(np.arange(height)[:, None], truth.shape)
    confirmed = truth_right[rows, np.clip(target, 0, width - 1)]
    with np.errstate(invalid='ignore'):
        agrees = np.abs(confirmed - truth) <= 1.0
    return inside & agrees

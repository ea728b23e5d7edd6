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

"""Flicker of a disparity video: how much it changes where the image does not."""

from __future__ import annotations

from dataclasses import dataclass
import math

import cv2
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.images import to_grey
from stereo_refine_ros.types import FloatMap, Image

Maps = tuple[FloatMap, FloatMap]

_NEIGHBOURHOOD = np.ones((5, 5), np.uint8)


@dataclass(frozen=True)
class TemporalNoise:
    """
    Flicker before and after refinement, over the same pixels; NaN where there are none.

    Attributes
    ----------
    preliminary, refined : float
        Mean absolute change between two frames, pixels of disparity.
    unchanged_ratio : float
        Share of the image that counts, 0..1.

    """

    preliminary: float
    refined: float
    unchanged_ratio: float


def compare_noise(views: tuple[Image, Image], preliminary: Maps, refined: Maps
                  ) -> TemporalNoise:
    """
    Compare the flicker of two maps where the image does not change.

    What counts is valid in both frames and in both maps: filling holes is neither punished nor
    praised here.

    Parameters
    ----------
    views : two uint8 ndarray of shape (H, W) or (H, W, 3) BGR
        Left view of the frame before and of this frame.
    preliminary, refined : two float32 ndarray of shape (H, W)
        The maps of these frames in pixels, NaN invalid.

    """
    counted = unchanged_pixels(*views)
    for values in (*preliminary, *refined):
        counted &= np.isfinite(values)
    return TemporalNoise(
        temporal_noise(*preliminary, counted), temporal_noise(*refined, counted),
        float(np.count_nonzero(counted)) / counted.size)


def unchanged_pixels(previous: Image, current: Image, threshold: int = 2) -> NDArray[np.bool_]:
    """
    Find pixels whose 5x5 neighbourhood changes by at most `threshold` grey levels.

    The neighbourhood keeps out pixels of a moving texture that are alike by chance.

    Parameters
    ----------
    previous, current : uint8 ndarray of shape (H, W) or (H, W, 3) BGR
        Left views of two successive frames.
    threshold : int
        Grey levels of sensor noise that still count as no change.

    """
    difference = cv2.absdiff(to_grey(previous), to_grey(current))
    return cv2.dilate(difference, _NEIGHBOURHOOD) <= threshold


def temporal_noise(previous: FloatMap, current: FloatMap, unchanged: NDArray[np.bool_]) -> float:
    """
    Mean absolute change of disparity in pixels between two frames.

    Parameters
    ----------
    previous, current : float32 ndarray of shape (H, W)
        Pixels, NaN invalid.
    unchanged : bool ndarray of shape (H, W)
        From `unchanged_pixels`; those of them that are valid in both frames count.

    Returns
    -------
    float
        NaN where no pixel counts.

    """
    change = np.abs(current[unchanged] - previous[unchanged])
    change = change[np.isfinite(change)]
    return float(np.mean(change, dtype=np.float64)) if change.size else math.nan

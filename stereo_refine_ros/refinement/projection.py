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


def fill_along_planes(values: FloatMap, labels: LabelMap, planes: NDArray[np.float64], low: float,
                      high: float) -> tuple[FloatMap, FloatMap]:
    """
    Fill holes with the planes of the nearest valid pixels to the left and right.

    What goes on behind an outline goes on in the plane of what is seen beside it.

    Parameters
    ----------
    values : float32 ndarray of shape (H, W)
        NaN where there is a hole.
    labels : int32 ndarray of shape (H, W)
        Segment of every pixel.
    planes : float64 ndarray of shape (N, 5)
        Of every segment, NaN for none: then its pixel's own disparity goes on.
    low, high : float
        The range that the planes are held in.

    Returns
    -------
    background, foreground : float32 ndarray of shape (H, W)
        The smaller and the larger of both sides; NaN in rows without a valid pixel.

    """
    background, foreground = np.empty((2, *values.shape), np.float32)
    _fill_kernel(values, labels, planes, low, high, background, foreground)
    return background, foreground


@njit(cache=True, nogil=True)
def _fill_kernel(values, labels, planes, low, high, background, foreground):
    height, width = values.shape
    for y in range(height):
        beside = -1
        for x in range(width):
            if not np.isnan(values[y, x]):
                beside = x
            background[y, x] = foreground[y, x] = _extend(
                y, x, beside, values, labels, planes, low, high)
        beside = -1
        for x in range(width - 1, -1, -1):
            if not np.isnan(values[y, x]):
                beside = x
                continue
            other = _extend(y, x, beside, values, labels, planes, low, high)
            if np.isnan(background[y, x]):
                background[y, x] = foreground[y, x] = other
            elif not np.isnan(other):
                background[y, x] = min(background[y, x], other)
                foreground[y, x] = max(foreground[y, x], other)


@njit(cache=True, nogil=True)
def _extend(y, x, beside, values, labels, planes, low, high):
    if beside < 0:
        return np.float32(np.nan)
    plane = planes[labels[y, beside]]
    if beside == x or np.isnan(plane[0]):
        return values[y, beside]
    return np.float32(min(max(bounded_disparity(plane, x, y), low), high))


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

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

from stereo_refine_ros.refinement.tuning import EXTRAPOLATION
from stereo_refine_ros.threads import run_bands
from stereo_refine_ros.types import FloatMap, LabelMap


def plane_disparities(labels: LabelMap, planes: NDArray[np.float64], low: float,
                      high: float, threads: int = 1) -> FloatMap:
    """Evaluate every pixel's plane, limited to low..high; NaN where its segment has none."""
    values = np.empty(labels.shape, np.float32)
    run_bands(_plane_kernel, len(labels), threads, labels, planes, low, high, values)
    return values


def fill_along_planes(values: FloatMap, labels: LabelMap, planes: NDArray[np.float64], low: float,
                      high: float, threads: int = 1) -> tuple[FloatMap, FloatMap]:
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
    threads : int
        Bands of rows side by side.

    Returns
    -------
    background, foreground : float32 ndarray of shape (H, W)
        The smaller and the larger of both sides; NaN in rows without a valid pixel.

    """
    background, foreground = values.copy(), values.copy()
    run_bands(_fill_kernel, len(values), threads, values, labels, planes, low, high, background,
              foreground)
    return background, foreground


@njit(cache=True, nogil=True)
def _fill_kernel(start, stop, values, labels, planes, low, high, background, foreground):
    width = values.shape[1]
    for y in range(start, stop):
        x = 0
        while x < width:
            if not np.isnan(values[y, x]):
                x += 1
                continue
            first = x
            while x < width and np.isnan(values[y, x]):
                x += 1
            # The hole reaches from `first` to before x.
            for z in range(first, x):
                left = _extend(y, z, first - 1, values, labels, planes, low, high)
                right = _extend(y, z, x, values, labels, planes, low, high)
                if first == 0:  # the border of the view, beyond which nothing is
                    left = right
                elif x == width:
                    right = left
                background[y, z], foreground[y, z] = min(left, right), max(left, right)


@njit(cache=True, nogil=True)
def _extend(y, x, beside, values, labels, planes, low, high):
    if beside < 0 or beside >= values.shape[1]:
        return np.float32(np.nan)
    label = labels[y, beside]
    if np.isnan(planes[label, 0]):
        return values[y, beside]
    return np.float32(_held(planes, label, x, y, low, high))


@njit(cache=True, nogil=True)
def _plane_kernel(start, stop, labels, planes, low, high, values):
    for y in range(start, stop):
        for x in range(labels.shape[1]):
            label = labels[y, x]
            if np.isnan(planes[label, 0]):
                values[y, x] = np.nan
            else:
                values[y, x] = _held(planes, label, x, y, low, high)


@njit(cache=True, nogil=True)
def _held(planes, label, x, y, low, high):
    """
    Disparity of a plane (a, b, c, low, high) at a pixel, little beyond where it was seen.

    A plane continues behind what hides it, but a slope that noise or a curved surface gave it
    must not run away at the border of the view.
    """
    d = planes[label, 0] * x + planes[label, 1] * y + planes[label, 2]
    d = min(max(d, planes[label, 3] - EXTRAPOLATION), planes[label, 4] + EXTRAPOLATION)
    return min(max(d, low), high)

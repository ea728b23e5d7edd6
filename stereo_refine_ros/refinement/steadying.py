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

"""
Steady in time: where the image stands still, so does the map.

What the last frame said is one more candidate, under the likelihood that it had there, and less
and less of it: it stands where the image has not changed and the new frame is less sure. Where
both say the same surface, their difference is noise, and is averaged away; what a whole
neighbourhood does together is no noise, and is followed at once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
import threading

import cv2
from numba import njit
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.images import to_grey
from stereo_refine_ros.refinement.tuning import (
    FADE_OF_LAST, FOLLOW_WINDOW, FRAMES_AVERAGED, SAME_SURFACE, UNCHANGED, UNCHANGED_NOISE)
from stereo_refine_ros.threads import run_bands
from stereo_refine_ros.types import FloatMap, Image

_WINDOW = np.ones((5, 5), np.uint8)


@dataclass(frozen=True, eq=False)
class _Last:
    """What is kept of a frame: blurred grey, map, confidence, and how many frames agreed."""

    grey: Image
    values: FloatMap
    confidence: FloatMap
    age: FloatMap
    left: Image
    is_own: bool = True


class FrameMemory:
    """
    The last frame of one camera. Frames may come from several threads; the latest done counts.

    Frames of another size or source begin anew, and so does the very same image: a sensor never
    takes it twice, so somebody refines one frame again.
    """

    def __init__(self) -> None:
        """Start without a frame."""
        self._lock = threading.Lock()
        self._last: _Last | None = None

    def steady(self, values: FloatMap, confidence: FloatMap, left: Image, noise_sigma: float,
               threads: int = 1, is_own: bool = True) -> tuple[FloatMap, FloatMap]:
        """
        Steady a refined map by the last one, and keep the result for the next.

        Parameters
        ----------
        values, confidence : float32 ndarray of shape (H, W)
            Of this frame; NaN in `values` stays.
        left : uint8 ndarray of shape (H, W) or (H, W, 3)
            The left view.
        noise_sigma : float
            Sensor noise of `left`, grey levels, NaN for none known.
        threads : int
            Bands of rows side by side.
        is_own : bool
            False for a refined map from outside: the two never mix.

        Returns
        -------
        values, confidence : float32 ndarray of shape (H, W)

        """
        grey = cv2.blur(to_grey(left), (3, 3)).reshape(values.shape)
        with self._lock:
            last = self._last
        now = _Last(grey, values, confidence, np.ones_like(values), left, is_own)
        if (last is not None and last.grey.shape == grey.shape and last.is_own == is_own
                and not np.array_equal(last.left, left)):
            now = _steadied(last, now, noise_sigma, threads)
        with self._lock:
            self._last = now
        return now.values, now.confidence


def _steadied(last: _Last, now: _Last, noise_sigma: float, threads: int) -> _Last:
    limit = UNCHANGED + UNCHANGED_NOISE * float(np.nan_to_num(noise_sigma))
    change = cv2.dilate(cv2.absdiff(now.grey, last.grey), _WINDOW)
    still = change.reshape(now.values.shape) <= limit
    difference = now.values - last.values
    is_same = still & (np.abs(difference) <= SAME_SURFACE)
    common = _local_mean(difference, is_same)
    out = replace(now, values=np.empty_like(now.values), confidence=np.empty_like(now.values),
                  age=np.empty_like(now.values))
    run_bands(_steady_kernel, len(now.values), threads, now.values, now.confidence, still,
              is_same, common, last.values, last.confidence, last.age, out.values,
              out.confidence, out.age)
    return out


def _local_mean(difference: FloatMap, is_same: NDArray[np.bool_]) -> FloatMap:
    """Mean change of what stayed on its surface around every pixel: what moves together."""
    size = (FOLLOW_WINDOW, FOLLOW_WINDOW)
    weight = is_same.astype(np.float32)
    total = cv2.blur(np.where(is_same, difference, np.float32(0)), size)
    return total / np.maximum(cv2.blur(weight, size), np.float32(1e-3))


@njit(cache=True, nogil=True)
def _steady_kernel(start, stop, values, confidence, still, is_same, common, before, sure, age,
                   out, out_sure, out_age):
    for y in range(start, stop):
        for x in range(values.shape[1]):
            value, known = values[y, x], confidence[y, x]
            kept_sure = sure[y, x] * np.float32(FADE_OF_LAST)
            if is_same[y, x]:
                count = min(age[y, x] + np.float32(1), np.float32(FRAMES_AVERAGED))
                moved = before[y, x] + common[y, x]
                out[y, x] = moved + (value - moved) / count
                out_sure[y, x] = known
                out_age[y, x] = count
            elif still[y, x] and kept_sure > known and not np.isnan(before[y, x]):
                out[y, x] = before[y, x]
                out_sure[y, x] = kept_sure
                out_age[y, x] = age[y, x]
            else:
                out[y, x] = value
                out_sure[y, x] = known
                out_age[y, x] = 1

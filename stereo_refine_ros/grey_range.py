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
Images of more than 8 bits to 8 bits, both views alike and steadily over time.

Cameras fill 10, 12, 14 or all 16 bits of a 16-bit image and seldom say how many, so black and
white are chosen from the pair itself. They are kept as long as they fit: an image that hardly
changes must not change its grey levels.
"""

from __future__ import annotations

import threading
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.types import Image

Deep = NDArray[np.uint16]

_MOST = 65535
# A range of fewer levels is not stretched: no step of the sensor becomes two of the image.
_LEAST = 255
# Few pixels that are hot or dead do not count; measured on about so many of a view.
_OUTLIERS_PERCENT = 0.1
_SAMPLES = 1 << 16
# Room left at either end when a range is chosen, and how much of it must stay in use.
_MARGIN = 0.125
_USED = 0.4


class SteadyRange:
    """The levels that become black and white, of one camera over time; threads may share it."""

    def __init__(self) -> None:
        """Choose at the first image of 16 bits."""
        self._lock = threading.Lock()
        self._limits: tuple[int, int] | None = None
        self._table: Image = np.zeros(0, np.uint8)

    def to_8bit(self, *views: NDArray[Any]) -> list[Image]:
        """
        Bring the views of one instant to 8 bits by one scale.

        Parameters
        ----------
        views : uint8 or uint16 ndarrays of any shape
            Those of 8 bits are returned as they are.

        Returns
        -------
        list of uint8 ndarray
            In the order of `views`, each of its shape.

        """
        deep = [view for view in views if view.dtype == np.uint16]
        if not deep:
            return list(views)
        with self._lock:
            self._adapt(deep)
            table = self._table
        return [np.take(table, view) if view.dtype == np.uint16 else view for view in views]

    def _adapt(self, views: list[Deep]) -> None:
        low, high = _range_of(views)
        if self._limits is None or not _fits(self._limits, low, high):
            self._limits = black, white = _choose(low, high)
            levels = (np.arange(_MOST + 1) - black) * (255.0 / (white - black))
            self._table = np.rint(np.clip(levels, 0, 255)).astype(np.uint8)


def same_kind(left: Image, right: Image) -> tuple[Image, Image]:
    """Turn both views grey where only one of them is."""
    if left.ndim == right.ndim:
        return left, right
    return _grey(left), _grey(right)


def _range_of(views: list[Deep]) -> tuple[int, int]:
    steps = [max(1, round((view.shape[0] * view.shape[1] / _SAMPLES) ** 0.5)) for view in views]
    sample = np.concatenate([
        view[::step, ::step].ravel() for view, step in zip(views, steps, strict=True)])
    low, high = np.percentile(sample, (_OUTLIERS_PERCENT, 100 - _OUTLIERS_PERCENT))
    return int(low), int(np.ceil(high))


def _choose(low: int, high: int) -> tuple[int, int]:
    margin = round((high - low) * _MARGIN)
    black, white = max(0, low - margin), min(_MOST, high + margin)
    if white - black < _LEAST:
        black = min(black, _MOST - _LEAST)
        white = black + _LEAST
    return black, white


def _fits(limits: tuple[int, int], low: int, high: int) -> bool:
    black, white = limits
    is_used = high - low >= _USED * (white - black) or white - black == _LEAST
    return black <= low and high <= white and is_used


def _grey(image: Image) -> Image:
    if image.ndim == 2:
        return image
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)

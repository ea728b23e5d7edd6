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

"""Faults that real cameras have, put into a clean pair one at a time."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import ArrayLike
from stereo_refine_ros.types import Image

Views = tuple[Image, Image]
Fault = Callable[[Image, Image], Views]

_BLUE_TO_RED = np.array([0.88, 1.0, 1.14])
_DARK, _DARK_NOISE = 0.12, 1.2
_CORNER_LOSS = 0.4


def lower(right: Image, rows: float) -> Image:
    """Move a view down by a fraction of a row."""
    return _warp(right, np.array([[1.0, 0, 0], [0, 1.0, rows]]))


def turn(right: Image, degrees: float) -> Image:
    """Turn a view about its centre, counter-clockwise."""
    centre = (right.shape[1] - 1) / 2, (right.shape[0] - 1) / 2
    return _warp(right, cv2.getRotationMatrix2D(centre, degrees, 1))


def vignette(right: Image) -> Image:
    """Darken a view towards its corners, as a lens does."""
    height, width = right.shape[:2]
    y, x = np.ogrid[-1:1:height * 1j, -1:1:width * 1j]
    light = 1 - _CORNER_LOSS * (x ** 2 + y ** 2) / 2
    return _levels(right * (light if right.ndim == 2 else light[..., None]))


def tint(right: Image) -> Image:
    """Balance the colours of a view otherwise; a grey view stays as it is."""
    return right if right.ndim == 2 else _levels(right * _BLUE_TO_RED)


def grey(view: Image) -> Image:
    """Take the colour from a view."""
    return view if view.ndim == 2 else np.asarray(cv2.cvtColor(view, cv2.COLOR_BGR2GRAY))


def noisy(left: Image, right: Image, sigma: float, factor: float = 1.0) -> Views:
    """Add independent noise to every value of both views, after dimming them by a factor."""
    random = np.random.default_rng(0)
    first, second = (_levels(factor * view + random.normal(0, sigma, view.shape))
                     for view in (left, right))
    return first, second


FAULTS: dict[str, Fault] = {
    'clean': lambda left, right: (left, right),
    'right 0.5 row lower': lambda left, right: (left, lower(right, 0.5)),
    'right 1 row lower': lambda left, right: (left, lower(right, 1.0)),
    'right 2 rows lower': lambda left, right: (left, lower(right, 2.0)),
    'right turned 0.2 degrees': lambda left, right: (left, turn(right, 0.2)),
    'right gain 0.8 - 8': lambda left, right: (left, _levels(0.8 * right - 8)),
    'right gamma 1.4': lambda left, right: (left, _levels(255 * (right / 255) ** 1.4)),
    'right vignetting': lambda left, right: (left, vignette(right)),
    'right white balance': lambda left, right: (left, tint(right)),
    'right blurred sigma 1': lambda left, right: (
        left, np.asarray(cv2.GaussianBlur(right, (0, 0), 1.0))),
    'grey': lambda left, right: (grey(left), grey(right)),
    'noise sigma 5': lambda left, right: noisy(left, right, 5.0),
    'noise sigma 10': lambda left, right: noisy(left, right, 10.0),
    'dark (x 0.12, noise 1.2)': lambda left, right: noisy(left, right, _DARK_NOISE, _DARK)}


def row_offset_of(fault: str, width: int) -> float:
    """Return the largest row offset that a fault puts into a view of this width, pixels."""
    if fault.startswith('right turned'):
        return float(np.sin(np.radians(0.2)) * (width - 1) / 2)
    return {'right 0.5 row lower': 0.5, 'right 1 row lower': 1.0,
            'right 2 rows lower': 2.0}.get(fault, 0.0)


def _levels(values: ArrayLike) -> Image:
    return np.rint(np.asarray(values)).clip(0, 255).astype(np.uint8)


def _warp(view: Image, matrix: np.ndarray) -> Image:
    return np.asarray(cv2.warpAffine(
        view, matrix, view.shape[1::-1], flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE))

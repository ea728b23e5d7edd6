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

"""The one place for grey images, gradients, replicated borders and half-size images."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]


def to_grey(image: Image) -> Image:
    """
    Turn an image grey, by the usual weights of blue, green and red.

    Parameters
    ----------
    image : uint8 ndarray of shape (H, W) or (H, W, 3)
        Grey or BGR.

    Returns
    -------
    uint8 ndarray of shape (H, W)
        A grey image itself, not a copy.

    """
    return image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)


def to_bgr(image: Image) -> Image:
    """Give an image three channels, uint8 (H, W, 3); one that has them comes back itself."""
    return image if image.ndim == 3 else cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)


def channels_of(image: NDArray[Any]) -> Sequence[NDArray[Any]]:
    """Take an image of any type apart, (H, W) each; a grey one is itself its one channel."""
    return (image,) if image.ndim == 2 else cv2.split(image)


def gradient_x(grey: Image, border: int = cv2.BORDER_REFLECT_101) -> NDArray[np.int16]:
    """
    Subtract from the grey level to the right of every pixel the one to its left.

    Parameters
    ----------
    grey : uint8 ndarray of shape (H, W)
        Grey levels.
    border : int
        OpenCV's name for what lies outside: reflected, the first and last column have no
        gradient; with cv2.BORDER_REPLICATE they have that of their one neighbour.

    Returns
    -------
    int16 ndarray of shape (H, W), -255..255

    """
    return cv2.Sobel(grey, cv2.CV_16S, 1, 0, ksize=1, borderType=border)


def gradient_y(grey: Image) -> NDArray[np.int16]:
    """Subtract from the grey level below every pixel the one above it; see `gradient_x`."""
    return cv2.Sobel(grey, cv2.CV_16S, 0, 1, ksize=1)


def pad(image: Image, rows: tuple[int, int], columns: tuple[int, int]) -> Image:
    """
    Surround an image by copies of its border pixels.

    Parameters
    ----------
    image : uint8 ndarray of shape (H, W) or (H, W, 3)
        Grey or BGR.
    rows, columns : tuple of int
        How many above and below, left and right.

    """
    return cv2.copyMakeBorder(image, *rows, *columns, cv2.BORDER_REPLICATE)


def halve(image: Image) -> Image:
    """
    Average every 2 x 2 pixels into one, the last row or column twice where it is alone.

    Parameters
    ----------
    image : uint8 ndarray of shape (H, W) or (H, W, 3)
        Grey or BGR.

    Returns
    -------
    uint8 ndarray of shape (ceil(H / 2), ceil(W / 2)) or that by 3
        Pixel x of the half stands for x + 0.5 = 2 (x_half + 0.5): disparities are half as large.

    """
    height, width = image.shape[:2]
    if height % 2 or width % 2:
        image = pad(image, (0, height % 2), (0, width % 2))
    return cv2.resize(image, ((width + 1) // 2, (height + 1) // 2), interpolation=cv2.INTER_AREA)


def doubled(values: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Give every pixel of an image of `shape` what its pixel of the half has; int32 or float32."""
    height, width = values.shape
    # Three times as fast as numpy's `repeat`.
    twice = cv2.resize(values, (2 * width, 2 * height), interpolation=cv2.INTER_NEAREST)
    return twice[:shape[0], :shape[1]]

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

"""What segments are made of and which ones touch: pixel lists, borders, colour differences."""

from __future__ import annotations

from dataclasses import dataclass

from numba import njit
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.types import Image, LabelMap


@dataclass(frozen=True, eq=False)
class Borders:
    """
    Every pair of segments that share a border, once.

    Attributes
    ----------
    pairs : int32 ndarray of shape (M, 2), lower label first
    length : int32 ndarray of shape (M,)
        Pixel edges along the border.
    color_change : float32 ndarray of shape (M,)
        Mean over the border of the summed absolute channel difference.

    """

    pairs: NDArray[np.int32]
    length: NDArray[np.int32]
    color_change: NDArray[np.float32]


def group_pixels(labels: LabelMap, count: int) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """
    List the pixels of every segment.

    Returns
    -------
    pixels : int32 ndarray of shape (H * W,)
        Flat indices, segment after segment, in raster order within each.
    starts : int32 ndarray of shape (N + 1,)
        Segment i owns pixels[starts[i]:starts[i + 1]].

    """
    pixels = np.empty(labels.size, np.int32)
    starts = np.zeros(count + 1, np.int32)
    _group_kernel(labels.reshape(-1), pixels, starts)
    return pixels, starts


def find_borders(labels: LabelMap, image: Image) -> Borders:
    """Find all pairs of 4-neighbouring segments with the length and contrast of their border."""
    height, width = labels.shape
    keys = np.empty(height * width * 2, np.int64)
    change = np.empty(height * width * 2, np.int32)
    found = _border_kernel(labels, image.reshape(height, width, -1), keys, change)
    unique, where, length = np.unique(keys[:found], return_inverse=True, return_counts=True)
    total = np.bincount(where, weights=change[:found], minlength=unique.size)
    pairs = np.stack([unique >> 32, unique & 0xFFFFFFFF], axis=1).astype(np.int32)
    return Borders(pairs, length.astype(np.int32),
                   (total / np.maximum(length, 1)).astype(np.float32))


@njit(cache=True, nogil=True)
def _group_kernel(labels, pixels, starts):
    for label in labels:
        starts[label + 1] += 1
    for i in range(starts.shape[0] - 1):
        starts[i + 1] += starts[i]
    cursor = starts.copy()
    for i in range(labels.shape[0]):
        pixels[cursor[labels[i]]] = i
        cursor[labels[i]] += 1


@njit(cache=True, nogil=True)
def _border_kernel(labels, image, keys, change):
    height, width = labels.shape
    found = 0
    for y in range(height):
        for x in range(width):
            for direction in range(2):
                ny, nx = y + direction, x + 1 - direction
                if ny == height or nx == width or labels[y, x] == labels[ny, nx]:
                    continue
                a, b = np.int64(labels[y, x]), np.int64(labels[ny, nx])
                keys[found] = (min(a, b) << 32) | max(a, b)
                total = np.int32(0)
                for c in range(image.shape[2]):
                    total += abs(np.int32(image[y, x, c]) - np.int32(image[ny, nx, c]))
                # Grey images count as three equal channels.
                change[found] = total * 3 // image.shape[2]
                found += 1
    return found

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

"""What the scanline matcher compares: gradients and two censuses of each view, in bytes."""

from __future__ import annotations

import math

import cv2
from numba import njit
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.images import channels_of, pad
from stereo_refine_ros.matching.tuning import CENSUS_STRIDES
from stereo_refine_ros.matching.vector_twins import PLANES
from stereo_refine_ros.types import Image

Bytes = NDArray[np.uint8]

_FLAT = 128  # a gradient of zero


def feature_planes(grey: Image, is_mirrored: bool, margin: int, out: Bytes) -> None:
    """
    Lay out the features of a view for the vector steps.

    Gradient along x and y (128 is none), three bytes of a 5x5 census for each of
    CENSUS_STRIDES, the pixels from one to the next that it looks at.

    Parameters
    ----------
    grey : uint8 ndarray of shape (H, W)
        The view.
    is_mirrored : bool
        Mirror the columns, so that growing disparity runs forward in memory.
    margin : int
        Entries of a plane before the first pixel and behind the last; left as they are.
    out : uint8 ndarray of length PLANES * (H * W + 2 * margin)
        Filled plane after plane.

    """
    if is_mirrored:
        grey = cv2.flip(grey, 1).reshape(grey.shape)
    height, width = grey.shape
    maps = out.reshape(PLANES, -1)[:, margin:margin + height * width].reshape(
        PLANES, height, width)
    sign = -1 if is_mirrored else 1
    reach = 2 * max(CENSUS_STRIDES)
    padded = pad(grey, (reach, reach), (reach, reach))
    _gradient_kernel(padded, reach, sign, maps[:2])
    for i, stride in enumerate(CENSUS_STRIDES):
        _census_kernel(padded, reach, stride, sign * stride, maps[2 + 3 * i:5 + 3 * i])


def alike(image: Image, edge_step: float, out: Bytes) -> None:
    """
    Mark the pixels of the second census that lie on no other side of an edge.

    What lies behind or before another surface moves against it from view to view: compared with
    it, a pixel is drawn to the wrong disparity.

    Parameters
    ----------
    image, edge_step
        As in `flat_steps`.
    out : uint8 ndarray of length 3 * H * W
        Filled plane after plane, bits as in the census: 1 where the pixel is alike.

    """
    stride = CENSUS_STRIDES[1]
    reach = 2 * stride
    channels = channels_of(pad(image, (reach, reach), (reach, reach)))
    _alike_kernel(np.stack(channels, axis=1), reach, stride, np.int16(_largest_flat(edge_step)),
                  out.reshape(3, *image.shape[:2]))


def _largest_flat(edge_step: float) -> int:
    """Return the largest difference of grey levels that is no edge; below 0: all are."""
    return min(max(math.ceil(edge_step) - 1, -1), 255)


def flat_steps(image: Image, edge_step: float) -> tuple[Bytes, Bytes]:
    """
    Mark the steps from the left and from above that cross no edge.

    Parameters
    ----------
    image : uint8 ndarray of shape (H, W) or (H, W, 3)
        Grey or colour.
    edge_step : float, grey levels
        A difference of at least this in any channel is an edge.

    Returns
    -------
    two uint8 ndarrays of shape (H, W)
        1 where there is no edge, also in the first column and the first row.

    """
    limit = _largest_flat(edge_step)
    flat = np.ones((2, *image.shape[:2]), np.uint8)
    for channel in channels_of(image):
        _flat_kernel(np.ascontiguousarray(channel).reshape(image.shape[:2]), limit, flat)
    return flat[0], flat[1]


@njit(cache=True, nogil=True)
def _flat_kernel(channel, limit, flat):
    height, width = channel.shape
    most = np.int16(limit)
    for y in range(height):
        here, along, down = channel[y], flat[0, y], flat[1, y]
        before, after = here[:width - 1], here[1:]
        along = along[1:]
        for x in range(width - 1):
            step = np.int16(abs(np.int16(after[x]) - np.int16(before[x])))
            along[x] &= np.uint8(step <= most)
        if y > 0:
            above = channel[y - 1]
            for x in range(width):
                step = np.int16(abs(np.int16(here[x]) - np.int16(above[x])))
                down[x] &= np.uint8(step <= most)


@njit(cache=True, nogil=True)
def _gradient_kernel(padded, reach, sign, out):
    height, width = out.shape[1:]
    for y in range(reach, reach + height):
        here, above, below = padded[y], padded[y - 1, reach:], padded[y + 1, reach:]
        after, before = here[reach + sign:], here[reach - sign:]
        across_row, down_row = out[0, y - reach], out[1, y - reach]
        for x in range(width):
            across = np.int16(after[x]) - np.int16(before[x])
            down = np.int16(below[x]) - np.int16(above[x])
            across_row[x] = np.uint8(min(max(across, -127), 127) + _FLAT)
            down_row[x] = np.uint8(min(max(down, -127), 127) + _FLAT)


@njit(cache=True, nogil=True)
def _census_kernel(padded, reach, down, right, out):
    height, width = out.shape[1:]
    for y in range(height):
        centre = padded[y + reach, reach:reach + width]
        for bit in range(24):
            place = bit if bit < 12 else bit + 1
            dy, dx = (place // 5 - 2) * down, (place % 5 - 2) * right
            there = padded[y + reach + dy, reach + dx:reach + dx + width]
            row, flag = out[bit >> 3, y], np.uint8(1 << (bit & 7))
            if bit & 7 == 0:
                for x in range(width):
                    row[x] = flag if there[x] < centre[x] else np.uint8(0)
            else:
                for x in range(width):
                    row[x] |= flag if there[x] < centre[x] else np.uint8(0)


@njit(cache=True, nogil=True)
def _alike_kernel(padded, reach, stride, limit, out):
    """Channels lie side by side in the rows of `padded`, so that one plain loop does for all."""
    height, width = out.shape[1:]
    channels, step = padded.shape[1:]
    flat = padded.reshape(padded.shape[0], channels * step)
    size = channels * step - 2 * reach
    least, most, same = np.empty((3, size), np.uint8)
    green, red = same[(channels > 1) * step:], same[(channels > 1) * 2 * step:]
    for y in range(height):
        centre = flat[y + reach, reach:reach + size]
        for i in range(size):
            level = np.int16(centre[i])
            least[i] = np.uint8(min(max(level - limit, 0), 255))
            most[i] = np.uint8(min(max(level + limit, 0), 255))
        for bit in range(24):
            place = bit if bit < 12 else bit + 1
            dy, dx = (place // 5 - 2) * stride, (place % 5 - 2) * stride
            there = flat[y + reach + dy, reach + dx:reach + dx + size]
            row, flag = out[bit >> 3, y], np.uint8(1 << (bit & 7))
            if bit & 7 == 0:
                row[:] = 0
            for i in range(size):
                same[i] = flag if (there[i] >= least[i]) & (there[i] <= most[i]) else np.uint8(0)
            for x in range(width):
                row[x] |= same[x] & green[x] & red[x]

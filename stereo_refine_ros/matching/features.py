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

import cv2
from numba import njit
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.matching.tuning import CENSUS_BLUR, CENSUS_STRIDES
from stereo_refine_ros.types import Image

Planes = tuple[NDArray[np.uint8], ...]

_FLAT = 128  # a gradient of zero


def feature_planes(grey: Image, is_mirrored: bool, margin: int) -> Planes:
    """
    Lay out the features of a view for the vector steps.

    Parameters
    ----------
    grey : uint8 ndarray of shape (H, W)
    is_mirrored : bool
        Mirror the columns, so that growing disparity runs forward in memory.
    margin : int
        Entries before the first pixel and behind the last.

    Returns
    -------
    eight flat uint8 arrays of length H * W + 2 * margin
        Gradient along x and y (128 is none), three bytes of the 5x5 census, three bytes of the
        5x5 census of the blurred view that looks CENSUS_STRIDES[1] pixels a step.

    """
    if is_mirrored:
        grey = cv2.flip(grey, 1).reshape(grey.shape)
    height, width = grey.shape
    flat = np.zeros((8, height * width + 2 * margin), np.uint8)
    maps = flat[:, margin:margin + height * width].reshape(8, height, width)
    sign = -1 if is_mirrored else 1
    _gradient_kernel(cv2.copyMakeBorder(grey, 1, 1, 1, 1, cv2.BORDER_REPLICATE), sign, maps[:2])
    for i, stride in enumerate(CENSUS_STRIDES):
        source = grey if i == 0 else cv2.blur(grey, CENSUS_BLUR).reshape(grey.shape)
        reach = 2 * stride
        wide = cv2.copyMakeBorder(source, reach, reach, reach, reach, cv2.BORDER_REPLICATE)
        _census_kernel(wide, stride, sign * stride, maps[2 + 3 * i:5 + 3 * i])
    return tuple(flat)


@njit(cache=True, nogil=True)
def _gradient_kernel(padded, sign, out):
    height, width = out.shape[1:]
    for y in range(height):
        for x in range(width):
            across = np.int32(padded[y + 1, x + 1 + sign]) - np.int32(padded[y + 1, x + 1 - sign])
            along = np.int32(padded[y + 2, x + 1]) - np.int32(padded[y, x + 1])
            out[0, y, x] = min(max(across, -127), 127) + _FLAT
            out[1, y, x] = min(max(along, -127), 127) + _FLAT


@njit(cache=True, nogil=True)
def _census_kernel(padded, down, right, out):
    height, width = out.shape[1:]
    reach = 2 * down
    for bit in range(24):
        place = bit if bit < 12 else bit + 1
        dy, dx = (place // 5 - 2) * down, (place % 5 - 2) * right
        plane, flag = out[bit >> 3], np.uint8(1 << (bit & 7))
        for y in range(height):
            centre = padded[y + reach, reach:reach + width]
            there = padded[y + reach + dy, reach + dx:reach + dx + width]
            row = plane[y]
            if bit & 7 == 0:
                for x in range(width):
                    row[x] = flag if there[x] < centre[x] else np.uint8(0)
            else:
                for x in range(width):
                    row[x] |= flag if there[x] < centre[x] else np.uint8(0)

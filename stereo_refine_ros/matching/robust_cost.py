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
Truncated matching cost of colour, census and gradient in eight bits.

Each term is truncated early and the three are added with equal weight: what one term gets wrong
(exposure, noise, repetition) cannot outvote the other two.
"""

from __future__ import annotations

import cv2
from numba import njit
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.threads import run_bands
from stereo_refine_ros.types import Image, StereoPair

# One unit of cost (a fully truncated term is 2/3) as stored.
COST_UNIT = 60
_COLOR_LIMIT = 75
_CENSUS_LIMIT = 14
_GRADIENT_LIMIT = 14
# A match outside the right view: worse than a fair match, better than a bad one.
OUT_OF_VIEW = int(0.9 * COST_UNIT)


def robust_cost_volume(pair: StereoPair, min_disparity: int, num_disparities: int,
                       threads: int = 1) -> NDArray[np.uint8]:
    """
    Cost of every disparity at every pixel of the left view.

    Returns
    -------
    uint8 ndarray of shape (H, W, D), 0..2 in units of 1 / COST_UNIT; index d - min_disparity.

    """
    assert pair.right is not None
    left = _features(pair.left)
    # Mirrored, the right row runs with growing disparity: the inner loop is contiguous.
    right = tuple(np.ascontiguousarray(plane[:, ::-1]) for plane in _features(pair.right))
    height, width = pair.shape
    volume = np.empty((height, width, num_disparities), np.uint8)
    run_bands(_cost_kernel, height, threads, left, right, min_disparity, volume)
    return volume


def _features(image: Image) -> tuple[np.ndarray, ...]:
    color = image if image.ndim == 3 else cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
    grey = cv2.cvtColor(color, cv2.COLOR_BGR2GRAY)
    blue, green, red = cv2.split(color)
    gradient_x = cv2.Sobel(grey, cv2.CV_16S, 1, 0, ksize=1)
    gradient_y = cv2.Sobel(grey, cv2.CV_16S, 0, 1, ksize=1)
    return blue, green, red, gradient_x, gradient_y, census_5x5(grey)


def census_5x5(grey: Image) -> NDArray[np.uint32]:
    """Return a bit for each of the 24 neighbours that is darker than the centre, (H, W)."""
    padded = cv2.copyMakeBorder(grey, 2, 2, 2, 2, cv2.BORDER_REPLICATE)
    census = np.empty(grey.shape, np.uint32)
    _census_kernel(padded, census)
    return census


@njit(cache=True, nogil=True)
def _census_kernel(padded, census):
    height, width = census.shape
    for y in range(height):
        for x in range(width):
            bits = np.uint32(0)
            centre = padded[y + 2, x + 2]
            for dy in range(5):
                for dx in range(5):
                    if dy != 2 or dx != 2:
                        darker = np.uint32(padded[y + dy, x + dx] < centre)
                        bits = np.uint32((bits << np.uint32(1)) | darker)
            census[y, x] = bits


@njit(cache=True, nogil=True, inline='always')
def _bit_count(bits):
    bits = np.uint32(bits - ((bits >> np.uint32(1)) & np.uint32(0x55555555)))
    pairs = np.uint32(bits & np.uint32(0x33333333))
    bits = np.uint32(pairs + ((bits >> np.uint32(2)) & np.uint32(0x33333333)))
    bits = np.uint32((bits + (bits >> np.uint32(4))) & np.uint32(0x0F0F0F0F))
    return np.int32(np.uint32(bits * np.uint32(0x01010101)) >> np.uint32(24))


@njit(cache=True, nogil=True)
def _cost_kernel(start, stop, left, right, min_disparity, volume):
    left_b, left_g, left_r, left_gx, left_gy, left_census = left
    right_b, right_g, right_r, right_gx, right_gy, right_census = right
    _, width, depth = volume.shape
    for y in range(start, stop):
        for x in range(width):
            shift = width - 1 - x + min_disparity
            first = min(max(0, -shift), depth)
            last = max(min(depth, width - shift), first)
            row = volume[y, x]
            row[:first] = OUT_OF_VIEW
            row[last:] = OUT_OF_VIEW
            blue, green = np.int32(left_b[y, x]), np.int32(left_g[y, x])
            red = np.int32(left_r[y, x])
            gx, gy = np.int32(left_gx[y, x]), np.int32(left_gy[y, x])
            bits = left_census[y, x]
            begin = shift + first
            rb = right_b[y, begin:shift + last]
            rg = right_g[y, begin:shift + last]
            rr = right_r[y, begin:shift + last]
            rgx = right_gx[y, begin:shift + last]
            rgy = right_gy[y, begin:shift + last]
            rbits = right_census[y, begin:shift + last]
            for i in range(last - first):
                color = np.int32(abs(np.int32(rb[i]) - blue) + abs(np.int32(rg[i]) - green)
                                 + abs(np.int32(rr[i]) - red))
                gradient = np.int32(abs(np.int32(rgx[i]) - gx) + abs(np.int32(rgy[i]) - gy))
                census = _bit_count(np.uint32(bits ^ rbits[i]))
                total = np.int32(min(color, np.int32(_COLOR_LIMIT)) * np.int32(14)
                                 + min(census, np.int32(_CENSUS_LIMIT)) * np.int32(75)
                                 + min(gradient, np.int32(_GRADIENT_LIMIT)) * np.int32(75))
                # 40 / (14 * 75) = 2497 / 65536: one term reaches two thirds of COST_UNIT.
                row[first + i] = np.uint8(np.int32(total * np.int32(2497)) >> np.int32(16))

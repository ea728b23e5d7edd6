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

from stereo_refine_ros.types import Image, StereoPair

Features = tuple[np.ndarray, ...]

# One unit of cost (a fully truncated term is 2/3) as stored.
COST_UNIT = 30
_COLOR_LIMIT = np.int16(75)
_CENSUS_LIMIT = np.int16(14)
_GRADIENT_LIMIT = np.int16(14)
# A match outside the right view: worse than a fair match, better than a bad one.
OUT_OF_VIEW = int(0.9 * COST_UNIT)
# Vector registers hold this many steps; a loop of another length crawls through its rest.
DEPTH_STEP = 32
PADDING = 2 * COST_UNIT


def padded_depth(num_disparities: int) -> int:
    """Round a number of disparities up to a multiple of DEPTH_STEP."""
    return -(-num_disparities // DEPTH_STEP) * DEPTH_STEP


def matching_features(pair: StereoPair, num_disparities: int) -> tuple[Features, Features]:
    """
    Compute what the cost compares: three colours, two gradients and the census of each view.

    The right view's planes are mirrored, so that growing disparity runs forward in memory, and
    padded by the depth at either end.
    """
    assert pair.right is not None
    depth = padded_depth(num_disparities)
    right = tuple(_mirrored(plane, depth) for plane in _features(pair.right))
    return _features(pair.left), right


def _mirrored(plane: np.ndarray, pad: int) -> np.ndarray:
    """Mirror the columns and add `pad` zeros at either end."""
    # OpenCV has no unsigned 32-bit images, and does not mind the sign.
    signed = plane.view(np.int32) if plane.dtype == np.uint32 else plane
    wide = cv2.copyMakeBorder(cv2.flip(signed, 1), 0, 0, pad, pad, cv2.BORDER_CONSTANT, value=0)
    return wide.view(plane.dtype)


def _features(image: Image) -> Features:
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
def fill_cost_row(y, left, right, min_disparity, num_disparities, volume):
    """
    Fill the costs of image row y, uint8 (W, P), 0..2 in units of 1 / COST_UNIT.

    Index d - min_disparity; P is D rounded up by `padded_depth`, from D on there is PADDING. For
    the features see `matching_features`.

    Every pixel runs over the whole depth, whatever is in view, for the sake of DEPTH_STEP.
    """
    left_b, left_g, left_r, left_gx, left_gy, left_census = left
    right_b, right_g, right_r, right_gx, right_gy, right_census = right
    width, depth = volume.shape
    for x in range(width):
        shift = width - 1 - x + min_disparity
        row = volume[x]
        begin = min(max(shift + depth, 0), width + depth)
        rb, rg, rr = right_b[y, begin:], right_g[y, begin:], right_r[y, begin:]
        rgx, rgy = right_gx[y, begin:], right_gy[y, begin:]
        rbits = right_census[y, begin:]
        blue, green, red = np.int16(left_b[y, x]), np.int16(left_g[y, x]), np.int16(left_r[y, x])
        gx, gy, bits = left_gx[y, x], left_gy[y, x], left_census[y, x]
        for i in range(depth):
            color = np.int16(abs(np.int16(rb[i] - blue)) + abs(np.int16(rg[i] - green))
                             + abs(np.int16(rr[i] - red)))
            slope = np.int16(abs(np.int16(rgx[i] - gx)) + abs(np.int16(rgy[i] - gy)))
            census = np.int16(_bit_count(np.uint32(bits ^ rbits[i])))
            total = np.int16(min(color, _COLOR_LIMIT) * np.int16(8)
                             + min(census, _CENSUS_LIMIT) * np.int16(43)
                             + min(slope, _GRADIENT_LIMIT) * np.int16(43))
            # 600 per term at its limit become two thirds of COST_UNIT, within 16 bits.
            row[i] = np.uint8(np.int16(total * np.int16(17)) >> np.int16(9))
        row[:min(max(0, -shift), depth)] = OUT_OF_VIEW
        row[max(min(depth, width - shift), 0):] = OUT_OF_VIEW
        row[num_disparities:] = PADDING

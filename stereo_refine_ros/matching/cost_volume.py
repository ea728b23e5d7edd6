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

"""The matching cost of the tree matchers: truncated colour and gradient differences."""

from __future__ import annotations

import cv2
from numba import njit
import numpy as np

from stereo_refine_ros.images import gradient_x, to_grey
from stereo_refine_ros.matching.tuning import COLOR_LIMIT, COLOR_WEIGHT, GRADIENT_LIMIT
from stereo_refine_ros.types import FloatMap, Image


def truncated_cost(base: Image, other: Image, min_disparity: int, num_disparities: int,
                   is_left: bool = True) -> FloatMap:
    """
    Compute 0.11 min(mean |dBGR|, 7) + 0.89 min(|d of the x-gradient of grey|, 2).

    Parameters
    ----------
    base, other : uint8 ndarray of shape (H, W) or (H, W, 3)
        The view whose pixels the volume belongs to, and the one it is compared with.
    min_disparity, num_disparities : int
        The searched range is [min_disparity, min_disparity + num_disparities).
    is_left : bool
        Whether `base` is the left view: its column x then meets x - d, else x + d.

    Returns
    -------
    float32 ndarray of shape (H, W, D)
        The last axis is d - min_disparity. Where the other column lies outside the image, the
        right view is compared with the border column. The left view takes the cost of the
        nearest pixel of the row that has a partner at d (the largest cost if none has): its
        border is what the result shows, and there the border column fits anything.

    References
    ----------
    Q. Yang, "A non-local cost aggregation method for stereo matching", CVPR 2012.

    """
    height, width = base.shape[:2]
    volume = np.empty((height, width, num_disparities), np.float32)
    partners = _features(other, is_left).transpose(0, 2, 1)
    _cost_kernel(np.ascontiguousarray(_features(base, is_left)),
                 np.ascontiguousarray(partners), min_disparity, is_left, volume)
    return volume


def _features(image: Image, is_mirrored: bool) -> FloatMap:
    """
    Stack the channels and the gradient: float32 of shape (H, W, C + 1).

    Mirrored images turn the partner x - d into x + d, so that the disparities of one pixel
    read forwards in memory for both views.
    """
    gradient = gradient_x(to_grey(image), cv2.BORDER_REPLICATE) * np.float32(0.5)
    stacked = np.dstack([image.astype(np.float32), gradient])
    return stacked[:, ::-1] if is_mirrored else stacked


@njit(cache=True, nogil=True)
def _cost_kernel(base, other, min_disparity, is_mirrored, volume):
    height, width = base.shape[:2]
    for y in range(height):
        for x in range(width):
            first, last = _partners(x + min_disparity, width, volume.shape[2])
            costs = volume[y, width - 1 - x if is_mirrored else x]
            _compare(base[y, x], other[y], x + min_disparity + first, costs[first:last])
            if not is_mirrored:
                _compare_border(base[y, x], other[y], 0, costs[:first])
                _compare_border(base[y, x], other[y], width - 1, costs[last:])
        if is_mirrored:
            _extend(volume[y, ::-1], min_disparity)


@njit(cache=True, nogil=True)
def _compare(pixel, planes, start, costs):
    """Fill `costs` with those of a pixel against the columns of a row from `start` on."""
    channels = pixel.size - 1
    scale = np.float32(COLOR_WEIGHT / channels)
    color_limit = np.float32(COLOR_WEIGHT * COLOR_LIMIT)
    weight, limit = np.float32(1.0 - COLOR_WEIGHT), np.float32(GRADIENT_LIMIT)
    costs[:] = 0
    for c in range(channels):
        value, partners = pixel[c], planes[c, start:start + costs.size]
        for k in range(costs.size):
            costs[k] += abs(value - partners[k])
    value, partners = pixel[channels], planes[channels, start:start + costs.size]
    for k in range(costs.size):
        costs[k] = min(costs[k] * scale, color_limit) \
            + weight * min(abs(value - partners[k]), limit)


@njit(cache=True, nogil=True)
def _compare_border(pixel, planes, column, costs):
    if costs.size > 0:
        _compare(pixel, planes, column, costs[:1])
        costs[1:] = costs[0]


@njit(cache=True, nogil=True)
def _partners(start: int, width: int, count: int) -> tuple[int, int]:
    """Return the range of k < count for which start + k is a column of the image."""
    first = min(max(-start, 0), count)
    return first, min(max(width - start, first), count)


@njit(cache=True, nogil=True)
def _extend(costs, min_disparity):
    """Copy costs along the row to the pixels without a partner."""
    width, num = costs.shape
    largest = np.float32(COLOR_WEIGHT * COLOR_LIMIT + (1.0 - COLOR_WEIGHT) * GRADIENT_LIMIT)
    costs[0, _partners(min_disparity, width, num)[1]:] = largest
    for x in range(1, width):
        last = _partners(x + min_disparity, width, num)[1]
        costs[x, last:] = costs[x - 1, last:]
    costs[width - 1, :_partners(width - 1 + min_disparity, width, num)[0]] = largest
    for x in range(width - 2, -1, -1):
        first = _partners(x + min_disparity, width, num)[0]
        costs[x, :first] = costs[x + 1, :first]

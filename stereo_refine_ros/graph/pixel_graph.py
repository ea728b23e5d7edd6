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
The image as a graph: neighbouring pixels joined by edges of 8-bit weight, sorted by counting.

An edge is one integer, its code: `pixel * K + direction`, with `pixel` the flat index y * W + x
and K = 2 directions (right, down) for 4 neighbours or K = 4 (also down-right, down-left) for 8.
`neighbour_offsets` turns a direction into the step of the flat index.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import reduce
from typing import Any

import cv2
from numba import njit
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.images import channels_of
from stereo_refine_ros.types import Image, require_image

IndexArray = NDArray[np.int32]

_STEPS = np.array([(0, 1), (1, 0), (1, 1), (1, -1)], np.int32)

# Relative weights, measured by benchmarks/segments.py on four sets of scenes with truth:
# the mean of an image's weights, in 8-bit levels (coarser: outdoor scenes lose; finer: the lab),
_MEAN_WEIGHT = 12.0
# the brightness, as a share of the mean one, at which logarithm turns from linear to relative,
_DARK_SHARE = 0.25
# the mean change of neighbours that is but rounding, grey levels (two uniform errors, blurred),
_ROUNDING = 0.25
# and the rows looked at to find the mean: one of so many.
_ROWS_APART = 4


def neighbour_offsets(width: int, directions: int = 2) -> IndexArray:
    """Return the step of the flat pixel index in each direction, int32 of shape (K,)."""
    return (_STEPS[:directions, 0] * width + _STEPS[:directions, 1]).astype(np.int32)


def edge_weights(image: Image, directions: int = 2) -> NDArray[np.uint8]:
    """
    Weigh the edges of the pixel graph by the largest difference of a channel.

    Parameters
    ----------
    image : uint8 ndarray of shape (H, W) or (H, W, 3)
        Grey or BGR.
    directions : {2, 4}
        2 for 4 neighbours, 4 for 8 neighbours.

    Returns
    -------
    uint8 ndarray of shape (H, W, directions)
        Entries whose neighbour lies outside the image are 0 and not part of the graph.

    """
    require_image('image', image)
    _require_directions(directions)
    weights = np.zeros((*image.shape[:2], directions), np.uint8)
    for place, change in _changes(image, directions):
        weights[place] = change
    return weights


def relative_edge_weights(image: Image, sigma: float,
                          directions: int = 2) -> NDArray[np.uint8]:
    """
    Weigh the edges by how large a change is in this image, not in grey levels.

    Changes of the logarithm of brightness (a shadow divides all levels alike), blurred before
    they are rounded, in units of their mean over the image: the same scene in grey, dark, in
    haze or with some noise has nearly the same weights, 12 in the mean.

    Parameters
    ----------
    image, directions
        As in `edge_weights`, and so is what is returned.
    sigma : float
        Gaussian blur, pixels; 0 for none.

    """
    require_image('image', image)
    _require_directions(directions)
    tones, rounding = _tones(image, sigma)
    changes = list(_changes(tones, directions))
    seen = [change[::_ROWS_APART] for _, change in changes[:2]]
    edges = sum(change.size for change in seen)
    mean = sum(int(change.sum(dtype=np.int64)) for change in seen) / max(edges, 1)
    weights = np.zeros((*image.shape[:2], directions), np.uint8)
    for place, change in changes:
        weights[place] = cv2.convertScaleAbs(change, alpha=_MEAN_WEIGHT / max(mean, rounding))
    return weights


def _tones(image: Image, sigma: float) -> tuple[NDArray[np.uint16], float]:
    """Return log(brightness) in 16 bits, blurred, and what rounding of the image changes in it."""
    mean = max(float(np.mean(cv2.mean(image)[:image[0, 0].size])), 1.0)
    dark = _DARK_SHARE * mean
    scale = 65535 / np.log1p(255 / dark)
    tones = cv2.LUT(image, np.rint(scale * np.log1p(np.arange(256) / dark)).astype(np.float32))
    if sigma > 0:  # in floats: OpenCV is several times faster with them than with 16 bits
        tones = cv2.GaussianBlur(tones, (0, 0), sigma)
    return np.asarray(tones, np.uint16), float(_ROUNDING * scale / (mean + dark))


def _changes(image: NDArray[Any], directions: int
             ) -> Iterator[tuple[tuple[slice, slice, int], NDArray[Any]]]:
    """Yield for each direction the largest change of a channel, and its place among weights."""
    height, width = image.shape[:2]
    channels = channels_of(image)
    for k, (down, right) in enumerate(_STEPS[:directions].tolist()):
        if height > down and width > abs(right):
            left, stop = max(0, -right), width - max(0, right)
            changes = [cv2.absdiff(channel[:height - down, left:stop],
                                   channel[down:, left + right:stop + right])
                       for channel in channels]
            yield (slice(0, height - down), slice(left, stop), k), reduce(cv2.max, changes)


def sort_edges(weights: NDArray[np.uint8], codes: IndexArray | None = None) -> IndexArray:
    """
    Sort edges by weight in linear time; equal weights keep their order.

    Many edges have equal weights, and their order shapes the trees that are grown from them.

    Parameters
    ----------
    weights : uint8 ndarray of shape (H, W, K)
        From `edge_weights`.
    codes : int32 ndarray of shape (E,), optional
        The edges to sort; if not given, all edges to the right, then all downward ones, and
        so on through the directions.

    Returns
    -------
    int32 ndarray of shape (E,)
        Edge codes in ascending order of weight.

    """
    if codes is None:
        height, width, directions = weights.shape
        order = np.empty(count_edges(height, width, directions), np.int32)
        _sort_all_kernel(weights, _STEPS[:directions], order)
        return order
    return _sort_kernel(weights.reshape(-1), codes)


def _require_directions(directions: int) -> None:
    if directions not in (2, 4):
        raise ValueError(f'directions: expected 2 or 4, got {directions}')


def count_edges(height: int, width: int, directions: int = 2) -> int:
    """Return the number of edges of the graph of an image of this size."""
    across = height * (width - 1) + (height - 1) * width
    return across if directions == 2 else across + 2 * (height - 1) * (width - 1)


@njit(cache=True, nogil=True)
def _columns(step_right: int, width: int) -> tuple[int, int]:
    """Return the first column whose neighbour is inside, and the one after the last."""
    return max(0, -step_right), width - max(0, step_right)


@njit(cache=True, nogil=True)
def _sort_all_kernel(weights, steps, order):
    height, width, directions = weights.shape
    starts = np.zeros(257, np.int64)
    for k in range(directions):
        first, stop = _columns(steps[k, 1], width)
        for y in range(height - steps[k, 0]):
            for x in range(first, stop):
                starts[np.int64(weights[y, x, k]) + 1] += 1
    for value in range(256):
        starts[value + 1] += starts[value]
    for k in range(directions):
        first, stop = _columns(steps[k, 1], width)
        for y in range(height - steps[k, 0]):
            for x in range(first, stop):
                weight = np.int64(weights[y, x, k])
                order[starts[weight]] = (y * width + x) * directions + k
                starts[weight] += 1


@njit(cache=True, nogil=True)
def _sort_kernel(weights, codes):
    starts = np.zeros(257, np.int64)
    for code in codes:
        starts[np.int64(weights[code]) + 1] += 1
    for value in range(256):
        starts[value + 1] += starts[value]
    order = np.empty(codes.size, np.int32)
    for code in codes:
        weight = np.int64(weights[code])
        order[starts[weight]] = code
        starts[weight] += 1
    return order

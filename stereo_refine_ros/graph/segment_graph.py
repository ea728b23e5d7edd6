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

from dataclasses import dataclass, replace

import cv2
from numba import njit
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.graph.pixel_graph import edge_weights
from stereo_refine_ros.graph.segmentation import segment_image
from stereo_refine_ros.params import SegmentationParams
from stereo_refine_ros.types import Image, LabelMap

IndexArray = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class PixelLists:
    """
    The pixels of every segment.

    Attributes
    ----------
    pixels : int32 ndarray of shape (H * W,)
        Flat indices, segment after segment, in raster order within each.
    starts : int32 ndarray of shape (N + 1,)
        Segment i owns pixels[starts[i]:starts[i + 1]].

    """

    pixels: IndexArray
    starts: IndexArray


@dataclass(frozen=True, eq=False)
class Borders:
    """
    Every pair of segments that share a border, once.

    Attributes
    ----------
    pairs : int32 ndarray of shape (M, 2)
        Labels of the two segments, the lower one first.
    length : float32 ndarray of shape (M,)
        Pixel edges along the border.
    color_distance : float32 ndarray of shape (M,)
        Summed absolute channel differences of the two segments' mean colours.
    middle : float32 ndarray of shape (M, 2)
        Mean x and y of the border.

    """

    pairs: IndexArray
    length: NDArray[np.float32]
    color_distance: NDArray[np.float32]
    middle: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class SegmentGraph:
    """
    An image as segments and as pixels: what lies in each, which touch, how alike they are.

    Attributes
    ----------
    labels : int32 ndarray of shape (H, W), 0..count - 1
    count : int
    lists : PixelLists
    borders : Borders
    weights : uint8 ndarray of shape (H, W, 2)
        Edge weights of the pixel graph of the median-filtered image.

    """

    labels: LabelMap
    count: int
    lists: PixelLists
    borders: Borders
    weights: NDArray[np.uint8]


def build_segment_graph(image: Image, params: SegmentationParams, scale: int = 1) -> SegmentGraph:
    """
    Segment an image and gather what lies between its segments and its pixels.

    `scale` is 2 for an image of half the size that the parameters are meant for.
    """
    params = replace(params, min_size=max(1, params.min_size // scale))
    labels, count = segment_image(image, params)
    weights = edge_weights(cv2.medianBlur(image, 3))
    return SegmentGraph(
        labels, count, group_pixels(labels, count), find_borders(labels, count, image), weights)


def group_pixels(labels: LabelMap, count: int) -> PixelLists:
    """List the pixels of segments 0..count - 1."""
    lists = PixelLists(np.empty(labels.size, np.int32), np.zeros(count + 1, np.int32))
    _group_kernel(labels.reshape(-1), lists.pixels, lists.starts)
    return lists


def find_borders(labels: LabelMap, count: int, image: Image) -> Borders:
    """Find all pairs of 4-neighbouring segments, and how alike the two are."""
    height, width = labels.shape
    channels = image.reshape(height, width, -1)
    pairs, sums = _border_kernel(labels, count)
    length = sums[:, 0]
    colors = _mean_color_kernel(labels, count, channels)
    # Grey images count as three equal channels.
    distance = np.abs(colors[pairs[:, 0]] - colors[pairs[:, 1]]).mean(axis=1) * 3
    return Borders(pairs, length, distance.astype(np.float32), sums[:, 1:] / length[:, None])


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
def _mean_color_kernel(labels, count, image):
    height, width, channels = image.shape
    # In single precision, sums over a large segment would be rounded.
    sums = np.zeros((count, channels))
    size = np.zeros(count, np.int64)
    for y in range(height):
        for x in range(width):
            label = labels[y, x]
            size[label] += 1
            for c in range(channels):
                sums[label, c] += image[y, x, c]
    for label in range(count):
        for c in range(channels):
            sums[label, c] /= size[label]
    return sums


@njit(cache=True, nogil=True)
def _border_kernel(labels, count):
    """Pairs of touching labels; sums of 1, x and y over each border."""
    edges, starts = _edges_by_lower_label(labels, count)
    height, width = labels.shape
    seen_for = np.full(count, -1, np.int32)
    slot = np.empty(count, np.int32)
    pairs = np.empty((edges.shape[0], 2), np.int32)
    sums = np.zeros((edges.shape[0], 3), np.float32)
    found = 0
    for low in range(count):
        for i in range(starts[low], starts[low + 1]):
            y, x = (edges[i] >> 1) // width, (edges[i] >> 1) % width
            down = edges[i] & 1
            ny, nx = y + down, x + 1 - down
            high = max(labels[y, x], labels[ny, nx])
            if seen_for[high] != low:
                seen_for[high] = low
                slot[high] = found
                pairs[found, 0], pairs[found, 1] = low, high
                found += 1
            row = sums[slot[high]]
            row[0] += 1
            row[1] += np.float32(0.5) * (x + nx)
            row[2] += np.float32(0.5) * (y + ny)
    return pairs[:found].copy(), sums[:found].copy()


@njit(cache=True, nogil=True)
def _edges_by_lower_label(labels, count):
    """Codes 2 * pixel + direction (0 right, 1 down) of all border edges, counting-sorted."""
    codes, lower, found = _border_edges(labels)
    starts = np.zeros(count + 1, np.int32)
    for i in range(found):
        starts[lower[i] + 1] += 1
    for i in range(count):
        starts[i + 1] += starts[i]
    cursor = starts.copy()
    edges = np.empty(found, np.int32)
    for i in range(found):
        edges[cursor[lower[i]]] = codes[i]
        cursor[lower[i]] += 1
    return edges, starts


@njit(cache=True, nogil=True)
def _border_edges(labels):
    """Codes of the border edges and their lower labels in raster order; how many there are."""
    height, width = labels.shape
    codes, lower = np.empty(2 * labels.size, np.int32), np.empty(2 * labels.size, np.int32)
    found = 0
    for y in range(height):
        last_row = y + 1 == height
        for x in range(width):
            here = labels[y, x]
            # Written in any case and kept by counting on: no jump that cannot be foreseen.
            right = here if x + 1 == width else labels[y, x + 1]
            codes[found] = 2 * (y * width + x)
            lower[found] = min(here, right)
            found += right != here
            below = here if last_row else labels[y + 1, x]
            codes[found] = 2 * (y * width + x) + 1
            lower[found] = min(here, below)
            found += below != here
    return codes, lower, found

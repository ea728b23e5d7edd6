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

"""Graph segmentation (Felzenszwalb & Huttenlocher 2004; the paper's equations 1-4)."""

from __future__ import annotations

import cv2
from numba import njit
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.graph.disjoint_set import find, make_sets, union
from stereo_refine_ros.graph.pixel_graph import (
    edge_weights, neighbour_offsets, relative_edge_weights, sort_edges)
from stereo_refine_ros.params import SegmentationParams
from stereo_refine_ros.types import Image, LabelMap, require_image


def segment_image(image: Image, params: SegmentationParams) -> tuple[LabelMap, int]:
    """
    Split an image into regions of like colour.

    Two components merge unless the lightest edge between them is heavier than what holds either
    together: Int(C) + k / |C|. Then components below `min_size` join their nearest neighbour.

    Parameters
    ----------
    image : uint8 ndarray of shape (H, W) or (H, W, 3)
        Grey or BGR.
    params : SegmentationParams
        k, blur, smallest size, neighbourhood, and whether weights are relative to the image.

    Returns
    -------
    labels : int32 ndarray of shape (H, W), numbered from 0 in raster order
    count : int
        Number of segments.

    """
    require_image('image', image)
    directions = 4 if params.diagonal else 2
    weights = _weigh(image, params, directions)
    height, width = image.shape[:2]
    parent, size = make_sets(height * width)
    labels = np.empty(height * width, np.int32)
    count = _segment_kernel(
        sort_edges(weights), weights.reshape(-1), neighbour_offsets(width, directions),
        np.float32(params.k), params.min_size, parent, size, labels)
    return labels.reshape(height, width), count


def _weigh(image: Image, params: SegmentationParams, directions: int) -> NDArray[np.uint8]:
    if params.adapt:
        return relative_edge_weights(image, params.sigma, directions)
    if params.sigma > 0:
        image = cv2.GaussianBlur(image, (0, 0), params.sigma)
    return edge_weights(image, directions)


@njit(cache=True, nogil=True)
def _segment_kernel(order, weights, offsets, k, min_size, parent, size, labels):
    # Two or four directions: a shift and a mask instead of a division per edge.
    shift = 1 if offsets.shape[0] == 2 else 2
    mask = offsets.shape[0] - 1
    limit = np.full(parent.shape[0], k, np.float32)
    left_over = 0
    for i in range(order.shape[0]):
        edge = order[i]
        pixel = edge >> shift
        other = pixel + offsets[edge & mask]
        if parent[pixel] == parent[other]:  # most are one set already
            continue
        a = find(parent, pixel)
        b = find(parent, other)
        if a == b:
            continue
        weight = np.float32(weights[edge])
        if weight <= min(limit[a], limit[b]):
            root = union(parent, size, a, b)
            limit[root] = weight + k / np.float32(size[root])
        else:
            order[left_over] = edge
            left_over += 1
    for i in range(left_over):
        edge = order[i]
        pixel = edge >> shift
        other = pixel + offsets[edge & mask]
        if parent[pixel] == parent[other]:
            continue
        a = find(parent, pixel)
        b = find(parent, other)
        if a != b and min(size[a], size[b]) < min_size:
            union(parent, size, a, b)
    return _number_kernel(parent, labels)


@njit(cache=True, nogil=True)
def _number_kernel(parent, labels):
    """Give the sets numbers 0, 1, ... by their first element; return how many there are."""
    number = np.full(parent.shape[0], -1, np.int32)
    count = 0
    for pixel in range(parent.shape[0]):
        root = find(parent, pixel)
        if number[root] < 0:
            number[root] = count
            count += 1
        labels[pixel] = number[root]
    return count

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
Cost aggregation on a spanning tree of the pixel graph.

Two trees: the minimum spanning tree of the whole image (non-local, Yang 2012) and the segment
tree (Mei et al. 2013), which grows inside segments first. Costs spread over the whole tree in
two passes; a path counts exp(-sum of its edge weights / (255 sigma)).
"""

from __future__ import annotations

from dataclasses import dataclass

from numba import njit
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.graph.disjoint_set import find, make_sets, union
from stereo_refine_ros.graph.pixel_graph import sort_edges
from stereo_refine_ros.graph.tuning import LARGE_SEGMENT, LINK_PENALTY, SEGMENT_SCALE
from stereo_refine_ros.types import FloatMap

IndexArray = NDArray[np.int32]
Weights = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class PixelTree:
    """
    A rooted spanning tree of the pixels.

    Attributes
    ----------
    order : int32 ndarray of shape (H * W,)
        Flat pixel indices, parents before their children. Depth first: neighbours in the order
        are mostly neighbours in memory.
    parent : int32 ndarray of shape (H * W,)
        Parent of every pixel; the root is its own.
    weight : uint8 ndarray of shape (H * W,)
        Weight of the edge from every pixel to its parent.

    """

    order: IndexArray
    parent: IndexArray
    weight: Weights


def minimum_tree(weights: Weights) -> PixelTree:
    """Build the minimum spanning tree of a pixel graph of weights (H, W, 2)."""
    sets = make_sets(weights.shape[0] * weights.shape[1])
    links = np.zeros(sets[0].size, np.uint8)
    _grow_kernel(weights.reshape(-1), sort_edges(weights), weights.shape[1], np.inf, sets, links)
    return _root(weights, links)


def segment_tree(weights: Weights) -> PixelTree:
    """
    Build the segment tree of a pixel graph of weights (H, W, 2).

    Segments grow by the criterion of Felzenszwalb & Huttenlocher with tau = 1200 / |C|; then
    the lightest edges link them, those between two segments above 50 px counting 5 more.
    """
    width = weights.shape[1]
    raised = weights.copy()
    sets = make_sets(weights.shape[0] * width)
    links = np.zeros(sets[0].size, np.uint8)
    codes = sort_edges(weights)
    _grow_kernel(weights.reshape(-1), codes, width, SEGMENT_SCALE, sets, links)
    crossing = codes[:_raise_kernel(raised.reshape(-1), codes, width, sets)]
    _grow_kernel(raised.reshape(-1), sort_edges(raised, crossing), width, np.inf, sets, links)
    return _root(raised, links)


def aggregate(volume: FloatMap, tree: PixelTree, sigma: float) -> None:
    """
    Replace a float32 volume of shape (H, W, D) by its weighted means over the tree.

    Means, unlike the sums of the papers, can be compared between pixels; the winners are the
    same.
    """
    rows = volume.reshape(-1, volume.shape[2])
    _aggregate_kernel(rows, tree.order, tree.parent, tree.weight, similarity_table(sigma))


def similarity_table(sigma: float) -> FloatMap:
    """Return exp(-w / (255 sigma)) for the weights w = 0..255."""
    return np.exp(-np.arange(256) / (255.0 * sigma)).astype(np.float32)


def _root(weights: Weights, links: Weights) -> PixelTree:
    count = links.size
    tree = PixelTree(
        np.empty(count, np.int32), np.zeros(count, np.int32), np.zeros(count, np.uint8))
    _root_kernel(weights.reshape(-1), links, weights.shape[1],
                 tree.order, tree.parent, tree.weight)
    return tree


@njit(cache=True, nogil=True)
def _ends(code, width):
    """Return the two pixels of an edge of the 4-neighbour graph."""
    pixel = code >> 1
    return pixel, pixel + (width if code & 1 else 1)


@njit(cache=True, nogil=True)
def _grow_kernel(weights, codes, width, scale, sets, links):
    """Join components in the order of their edges; bits of `links`: right, down, left, up."""
    parent, size = sets
    limits = scale / size
    for code in codes:
        a, b = _ends(code, width)
        root_a, root_b = find(parent, a), find(parent, b)
        weight = weights[code]
        if root_a == root_b or weight > min(limits[root_a], limits[root_b]):
            continue
        root = union(parent, size, root_a, root_b)
        limits[root] = weight + scale / size[root]
        links[a] |= 1 << (code & 1)
        links[b] |= 4 << (code & 1)


@njit(cache=True, nogil=True)
def _raise_kernel(weights, codes, width, sets):
    """Penalise edges between large segments; move those between any to the front of `codes`."""
    parent, size = sets
    count = 0
    for code in codes:
        a, b = _ends(code, width)
        root_a, root_b = find(parent, a), find(parent, b)
        if root_a == root_b:
            continue
        if min(size[root_a], size[root_b]) > LARGE_SEGMENT:
            weights[code] = min(np.int32(weights[code]) + LINK_PENALTY, 255)
        codes[count] = code
        count += 1
    return count


@njit(cache=True, nogil=True)
def _root_kernel(weights, links, width, order, parent, weight):
    stack = np.empty(order.size, np.int32)
    stack[0] = 0
    height, count = 1, 0
    while height > 0:
        height -= 1
        pixel = stack[height]
        order[count] = pixel
        count += 1
        for direction in range(4):
            if not links[pixel] >> direction & 1:
                continue
            step = width if direction & 1 else 1
            neighbour = pixel + step if direction < 2 else pixel - step
            if neighbour == parent[pixel]:
                continue
            parent[neighbour] = pixel
            weight[neighbour] = weights[2 * min(pixel, neighbour) + (direction & 1)]
            stack[height] = neighbour
            height += 1


@njit(cache=True, nogil=True)
def _aggregate_kernel(rows, order, parent, weight, table):
    support = np.ones(order.size, np.float32)
    for i in range(order.size - 1, 0, -1):
        pixel = order[i]
        similarity = table[weight[pixel]]
        child, above = rows[pixel], rows[parent[pixel]]
        for k in range(child.size):
            above[k] += similarity * child[k]
        support[parent[pixel]] += similarity * support[pixel]
    root = rows[order[0]]
    for k in range(root.size):
        root[k] /= support[order[0]]
    for i in range(1, order.size):
        pixel = order[i]
        similarity = table[weight[pixel]]
        from_above = similarity * support[parent[pixel]]
        from_below = np.float32(1) - similarity * similarity
        support[pixel] = from_above + from_below * support[pixel]
        from_above /= support[pixel]
        from_below /= support[pixel]
        child, above = rows[pixel], rows[parent[pixel]]
        for k in range(child.size):
            child[k] = from_above * above[k] + from_below * child[k]

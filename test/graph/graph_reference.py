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

"""Slow, obvious versions of the graph kernels, on lists, sets and dictionaries."""

from __future__ import annotations

import numpy as np

STEPS = [(0, 1), (1, 0), (1, 1), (1, -1)]


def graph_edges(image, directions):
    """List (weight, code, pixel, neighbour) of every edge of the pixel graph, unsorted."""
    height, width = image.shape[:2]
    values = image.reshape(height, width, -1).astype(int)
    edges = []
    for y in range(height):
        for x in range(width):
            for k, (dy, dx) in enumerate(STEPS[:directions]):
                if y + dy < height and 0 <= x + dx < width:
                    weight = np.abs(values[y, x] - values[y + dy, x + dx]).max()
                    pixel = y * width + x
                    edges.append((
                        int(weight), pixel * directions + k, pixel,
                        (y + dy) * width + x + dx))
    return edges


def spanning_tree_weight(edges, count):
    """Return the total weight of a minimum spanning tree, by Prim's algorithm."""
    inside, total = {0}, 0
    while len(inside) < count:
        crossing = [e for e in edges if (e[2] in inside) != (e[3] in inside)]
        weight, _, a, b = min(crossing)
        inside |= {a, b}
        total += weight
    return total


def segment_tree_edges(image, scale, large, penalty):
    """Return {code: weight} of the segment tree, with sets as Python sets."""
    edges = sorted(graph_edges(image, 2), key=lambda edge: (edge[0], edge[1] % 2, edge[1]))
    group = {pixel: frozenset([pixel]) for edge in edges for pixel in edge[2:]}
    largest, tree = {}, {}

    def join(weight, code, a, b):
        merged = group[a] | group[b]
        for pixel in merged:
            group[pixel] = merged
        largest[merged] = weight
        tree[code] = weight

    for weight, code, a, b in edges:
        limits = [largest.get(group[p], 0) + scale / len(group[p]) for p in (a, b)]
        if group[a] != group[b] and weight <= min(limits):
            join(weight, code, a, b)
    linking = []
    for weight, code, a, b in edges:
        if group[a] != group[b]:
            is_large = min(len(group[a]), len(group[b])) > large
            linking.append((min(weight + penalty * is_large, 255), code, a, b))
    for weight, code, a, b in sorted(linking, key=lambda edge: edge[0]):
        if group[a] != group[b]:
            join(weight, code, a, b)
    return tree


def tree_means(volume, edges, sigma):
    """Return the weighted means over a tree of edges (weight, pixel, pixel), pair by pair."""
    count = volume.shape[0] * volume.shape[1]
    distance = np.full((count, count), np.inf)
    np.fill_diagonal(distance, 0)
    for weight, a, b in edges:
        distance[a, b] = distance[b, a] = weight
    for via in range(count):
        distance = np.minimum(distance, distance[:, [via]] + distance[[via], :])
    similarity = np.exp(-distance / (255 * sigma))
    rows = volume.reshape(count, -1).astype(float)
    return (similarity @ rows / similarity.sum(axis=1, keepdims=True)).reshape(volume.shape)


def sorted_edges(image, directions, weights=None):
    """List (weight, pixel, pixel) by weight; equal ones by direction, then in raster order."""
    height, width = image.shape[:2]
    values = image.reshape(height, width, -1).astype(int)
    edges = []
    for k, (dy, dx) in enumerate(STEPS[:directions]):
        for y in range(height - dy):
            for x in range(max(0, -dx), min(width, width - dx)):
                weight = np.abs(values[y, x] - values[y + dy, x + dx]).max() \
                    if weights is None else weights[y, x, k]
                edges.append((int(weight), (y, x), (y + dy, x + dx)))
    return sorted(edges, key=lambda edge: edge[0])


def segment(image, k, min_size, directions, weights=None):
    """Merge sets of pixels edge by edge; return labels in raster order and their number."""
    component = {pixel: frozenset([pixel]) for pixel in np.ndindex(image.shape[:2])}
    largest = {}

    def join(a, b):
        merged = component[a] | component[b]
        for pixel in merged:
            component[pixel] = merged
        return merged

    def limit(pixel):
        members = component[pixel]
        return np.float32(largest.get(members, 0)) + np.float32(k) / np.float32(len(members))

    edges = sorted_edges(image, directions, weights)
    for weight, a, b in edges:
        if component[a] is not component[b] and weight <= min(limit(a), limit(b)):
            largest[join(a, b)] = weight
    for _, a, b in edges:
        if component[a] is not component[b] \
                and min(len(component[a]), len(component[b])) < min_size:
            join(a, b)
    numbers = {}
    labels = np.array([[numbers.setdefault(component[y, x], len(numbers))
                        for x in range(image.shape[1])] for y in range(image.shape[0])])
    return labels, len(numbers)


def borders(labels, image):
    """Return {(low, high): (length, colour distance, middle x, middle y)}."""
    height, width = labels.shape
    image = image.astype(float)
    if image.ndim == 2:
        image = np.repeat(image[..., None], 3, axis=2)
    steps = {}
    for y, x in np.ndindex(height, width):
        for v, u in ((y, x + 1), (y + 1, x)):
            if v < height and u < width and labels[v, u] != labels[y, x]:
                pair = tuple(sorted((int(labels[y, x]), int(labels[v, u]))))
                steps.setdefault(pair, []).append(((x + u) / 2, (y + v) / 2))
    found = {}
    for (low, high), rows in steps.items():
        distance = np.abs(image[labels == low].mean(0) - image[labels == high].mean(0)).sum()
        x, y = np.mean(rows, axis=0)
        found[low, high] = len(rows), distance, x, y
    return found

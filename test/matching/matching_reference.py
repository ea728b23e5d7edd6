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

"""Slow, obvious versions of the matching kernels, on lists and dictionaries."""

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

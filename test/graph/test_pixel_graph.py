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

"""The pixel graph and the disjoint sets, against slow versions and on hand-made images."""

from graph_reference import graph_edges
import numpy as np
import pytest

from stereo_refine_ros.graph.disjoint_set import find, make_sets, union
from stereo_refine_ros.graph.pixel_graph import (
    count_edges, edge_weights, neighbour_offsets, sort_edges)


@pytest.mark.parametrize('directions', [2, 4])
@pytest.mark.parametrize('shape', [(5, 7, 3), (6, 4), (1, 5, 3), (5, 1, 3), (1, 1)])
def test_edges_are_the_sorted_edges_of_the_naive_graph(shape, directions):
    image = np.random.default_rng(1).integers(0, 256, shape, dtype=np.uint8)
    weights = edge_weights(image, directions)
    expected = sorted(
        graph_edges(image, directions),
        key=lambda edge: (edge[0], edge[1] % directions, edge[1]))
    order = sort_edges(weights)
    assert order.tolist() == [code for _, code, _, _ in expected]
    assert weights.reshape(-1)[order].tolist() == [weight for weight, _, _, _ in expected]
    assert count_edges(*shape[:2], directions) == len(expected)
    pixel, direction = np.divmod(order, directions)
    neighbours = pixel + neighbour_offsets(shape[1], directions)[direction]
    assert neighbours.tolist() == [neighbour for _, _, _, neighbour in expected]


def test_weight_is_the_largest_channel_difference_and_does_not_wrap():
    image = np.array([[[250, 10, 3], [5, 11, 3]]], np.uint8)
    assert edge_weights(image).tolist() == [[[245, 0], [0, 0]]]


def test_edge_weights_refuses_other_neighbourhoods():
    with pytest.raises(ValueError, match='directions: expected 2 or 4, got 3'):
        edge_weights(np.zeros((2, 2), np.uint8), 3)


def test_union_joins_and_counts_and_find_agrees_with_a_dictionary():
    generator = np.random.default_rng(2)
    parent, size = make_sets(30)
    group = {node: {node} for node in range(30)}
    for a, b in generator.integers(0, 30, (40, 2)):
        root_a, root_b = find(parent, a), find(parent, b)
        assert (root_a == root_b) == (group[a] is group[b])
        if root_a == root_b:
            continue
        root = union(parent, size, root_a, root_b)
        group[a] |= group[b]
        for node in group[b]:
            group[node] = group[a]
        assert size[root] == len(group[a])
    roots = {frozenset(members) for members in group.values()}
    assert len({find(parent, node) for node in range(30)}) == len(roots)

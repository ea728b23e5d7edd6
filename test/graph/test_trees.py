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

"""The two trees and the aggregation against slow versions."""

import graph_reference
import numpy as np
import pytest

from stereo_refine_ros.graph import trees
from stereo_refine_ros.graph.pixel_graph import edge_weights
from stereo_refine_ros.graph.trees import aggregate, minimum_tree, segment_tree


def random_image(shape=(6, 7, 3), levels=40, seed=5):
    return np.random.default_rng(seed).integers(0, levels, shape, dtype=np.uint8)


def tree_edges(tree, root=0):
    """List (weight, pixel, parent) of a tree, after checking that it is one."""
    count = tree.order.size
    assert sorted(tree.order.tolist()) == list(range(count))
    assert tree.order[0] == root and tree.parent[root] == root
    position = np.empty(count, int)
    position[tree.order] = np.arange(count)
    others = tree.order[1:]
    assert np.all(position[tree.parent[others]] < position[others])
    return [(int(tree.weight[p]), int(p), int(tree.parent[p])) for p in others]


@pytest.mark.parametrize('shape', [(6, 7, 3), (1, 9), (8, 1, 3)])
def test_minimum_tree_is_spanning_and_minimal(shape):
    image = random_image(shape)
    edges = tree_edges(minimum_tree(edge_weights(image)))
    graph = {(a, b): weight for weight, _, a, b in graph_reference.graph_edges(image, 2)}
    assert all(graph[min(a, b), max(a, b)] == weight for weight, a, b in edges)
    expected = graph_reference.spanning_tree_weight(
        graph_reference.graph_edges(image, 2), image.shape[0] * image.shape[1])
    assert sum(weight for weight, _, _ in edges) == expected


@pytest.mark.parametrize('seed', range(4))
def test_segment_tree_is_the_naive_one(seed, monkeypatch):
    image = random_image((9, 10), 60, seed)
    image[:, 5:] += 120
    monkeypatch.setattr(trees, 'SEGMENT_SCALE', 60.0)
    weights = edge_weights(image)
    expected = graph_reference.segment_tree_edges(image, 60.0, 50, 5)
    width = image.shape[1]
    edges = tree_edges(segment_tree(weights))
    codes = {2 * min(a, b) + (abs(a - b) == width): weight for weight, a, b in edges}
    assert codes == expected


def test_the_link_between_two_large_segments_is_five_heavier():
    image = np.zeros((8, 16), np.uint8)
    image[:, 8:] = 200
    weights = edge_weights(image)
    assert max(tree_edges(segment_tree(weights)))[0] == 205
    assert max(tree_edges(segment_tree(edge_weights(image[:, 4:]))))[0] == 200


@pytest.mark.parametrize('build', [minimum_tree, segment_tree])
def test_aggregation_is_the_weighted_mean_over_all_pairs_of_pixels(build):
    image = random_image()
    tree = build(edge_weights(image))
    volume = np.random.default_rng(6).random((6, 7, 5), dtype=np.float32)
    expected = graph_reference.tree_means(volume, tree_edges(tree), 0.1)
    aggregate(volume, tree, 0.1)
    np.testing.assert_allclose(volume, expected, rtol=2e-5)


def test_a_tree_of_one_pixel_changes_nothing():
    tree = minimum_tree(edge_weights(np.zeros((1, 1), np.uint8)))
    volume = np.full((1, 1, 3), 2.5, np.float32)
    aggregate(volume, tree, 0.1)
    assert volume.tolist() == [[[2.5, 2.5, 2.5]]]

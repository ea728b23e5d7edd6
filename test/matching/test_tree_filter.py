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

"""Yang's refinement against a slow version."""

import numpy as np
import pytest

from stereo_refine_ros.graph.pixel_graph import edge_weights
from stereo_refine_ros.graph.trees import minimum_tree
from stereo_refine_ros.matching.tree_filter import spread_over_tree


def naive_spread(values, tree, min_disparity, num_disparities, sigma):
    """Vote along every path of the tree, pair by pair."""
    count = values.size
    paths = []
    for pixel in range(count):
        path, total = {pixel: 0}, 0
        while tree.parent[pixel] != pixel:
            total += int(tree.weight[pixel])
            pixel = int(tree.parent[pixel])
            path[pixel] = total
        paths.append(path)
    flat = values.reshape(-1).astype(float)
    best = np.empty(count)
    candidates = min_disparity + np.arange(num_disparities)
    for a in range(count):
        costs = np.zeros(num_disparities)
        for b in np.flatnonzero(np.isfinite(flat)):
            length = min(paths[a][p] + paths[b][p] for p in paths[a] if p in paths[b])
            costs += np.exp(-length / (255 * sigma)) * np.abs(candidates - flat[b])
        best[a] = candidates[costs.argmin()]
    return best.reshape(values.shape)


@pytest.mark.parametrize('threads', [1, 2])
@pytest.mark.parametrize('min_disparity', [0, -4])
def test_spread_is_the_naive_vote(min_disparity, threads):
    generator = np.random.default_rng(9)
    tree = minimum_tree(edge_weights(generator.integers(0, 60, (5, 7), dtype=np.uint8)))
    values = generator.uniform(min_disparity, min_disparity + 8, (5, 7)).astype(np.float32)
    values[generator.random((5, 7)) < 0.5] = np.nan
    expected = naive_spread(values, tree, min_disparity, 9, 0.05)
    result = spread_over_tree(values, tree, min_disparity, 9, 0.05, threads)
    assert result.dtype == np.float32
    np.testing.assert_array_equal(result, expected)


def test_holes_take_the_disparity_of_their_own_surface():
    image = np.zeros((6, 10), np.uint8)
    image[:, 5:] = 200
    values = np.full((6, 10), 3, np.float32)
    values[:, 5:] = 8
    holes = values.copy()
    holes[:, 3:9] = np.nan
    tree = minimum_tree(edge_weights(image))
    np.testing.assert_array_equal(spread_over_tree(holes, tree, 0, 10, 0.05), values)


def test_without_votes_the_smallest_disparity_is_left():
    tree = minimum_tree(edge_weights(np.zeros((2, 3), np.uint8)))
    values = np.full((2, 3), np.nan, np.float32)
    assert np.all(spread_over_tree(values, tree, 2, 5, 0.05, threads=2) == 2)

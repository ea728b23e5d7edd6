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
    count_edges, edge_weights, neighbour_offsets, relative_edge_weights, sort_edges)


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


def relative_weights_by_hand(image, directions):
    """Weigh edges by change of log brightness in units of its mean on rows 0, 4, 8, ..."""
    height, width = image.shape[:2]
    dark = max(image.mean(), 1) / 4
    scale = 65535 / np.log(1 + 255 / dark)
    tones = np.rint(scale * np.log(1 + image.astype(float) / dark)).reshape(height, width, -1)
    change = {}
    for y, x, k in np.ndindex(height, width, directions):
        v, u = y + (k > 0), x + (1, 0, 1, -1)[k]
        if v < height and 0 <= u < width:
            change[y, x, k] = np.abs(tones[y, x] - tones[v, u]).max()
    seen = [value for (y, _, k), value in change.items() if y % 4 == 0 and k < 2]
    rounding = 0.25 * scale / (4 * dark + dark)
    unit = max(np.mean(seen) if seen else 0, rounding)
    weights = np.zeros((height, width, directions))
    for edge, value in change.items():
        weights[edge] = min(255, np.floor(value * 12 / unit + 0.5))
    return weights


@pytest.mark.parametrize('directions', [2, 4])
@pytest.mark.parametrize('shape', [(6, 7, 3), (9, 5), (1, 6, 3), (6, 1), (1, 1, 3)])
def test_relative_weights_are_those_of_the_definition(shape, directions):
    image = np.random.default_rng(4).integers(0, 256, shape, dtype=np.uint8)
    weights = relative_edge_weights(image, 0.0, directions)
    assert weights.dtype == np.uint8
    # The scale is rounded to single precision: a tie may fall to either side.
    np.testing.assert_allclose(weights, relative_weights_by_hand(image, directions), atol=1)
    assert (weights != relative_weights_by_hand(image, directions)).mean() < 0.02


def test_a_gain_changes_no_relative_weight_by_more_than_rounding_does():
    image = np.random.default_rng(5).integers(0, 100, (12, 15, 3), dtype=np.uint8)
    weights = relative_edge_weights(image, 0.5).astype(int)
    np.testing.assert_allclose(relative_edge_weights(2 * image, 0.5), weights, atol=1)


def test_grey_and_three_equal_channels_weigh_the_same():
    image = np.random.default_rng(6).integers(0, 256, (9, 11), dtype=np.uint8)
    np.testing.assert_array_equal(
        relative_edge_weights(np.dstack([image] * 3), 0.5), relative_edge_weights(image, 0.5))


@pytest.mark.parametrize('level', [7, 100, 255])
def test_rounding_of_a_flat_image_is_not_blown_up(level):
    image = np.full((20, 30), level, np.uint8)
    assert relative_edge_weights(image, 0.5).max() == 0
    # Four edges of 2370 would make a mean that a step of one grey level exceeds 590 times.
    image[10, 15] = level - 1
    assert relative_edge_weights(image, 0.0).max() == pytest.approx(12 / 0.25, abs=5)


def test_relative_weights_refuse_what_edge_weights_refuses():
    with pytest.raises(ValueError, match='directions: expected 2 or 4, got 3'):
        relative_edge_weights(np.zeros((2, 2), np.uint8), 0.5, 3)
    with pytest.raises(ValueError, match='image: expected uint8'):
        relative_edge_weights(np.zeros((2, 2), np.float32), 0.5)


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

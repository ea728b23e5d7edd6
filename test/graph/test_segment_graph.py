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

"""Pixel lists and borders against dictionaries."""

import cv2
import graph_reference
import numpy as np
import pytest

from stereo_refine_ros.graph.pixel_graph import edge_weights
from stereo_refine_ros.graph.segment_graph import build_segment_graph, find_borders, group_pixels
from stereo_refine_ros.graph.segmentation import segment_image
from stereo_refine_ros.params import SegmentationParams


def segmented(shape, seed=0, min_size=2):
    image = np.random.default_rng(seed).integers(0, 256, shape, dtype=np.uint8)
    labels, count = segment_image(image, SegmentationParams(30.0, 0.0, min_size))
    return image, labels, count


@pytest.mark.parametrize('shape', [(9, 8, 3), (1, 12), (11, 1, 3), (1, 1)])
def test_pixels_are_listed_by_segment_in_raster_order(shape):
    _, labels, count = segmented(shape)
    lists = group_pixels(labels, count)
    assert lists.pixels.dtype == lists.starts.dtype == np.int32
    assert lists.starts[0] == 0 and lists.starts[-1] == labels.size
    for label in range(count):
        listed = lists.pixels[lists.starts[label]:lists.starts[label + 1]]
        np.testing.assert_array_equal(listed, np.flatnonzero(labels == label))


@pytest.mark.parametrize('shape', [(9, 8, 3), (10, 9), (1, 12), (11, 1, 3)])
def test_borders_are_those_of_the_slow_version(shape):
    image, labels, count = segmented(shape, seed=3)
    found = find_borders(labels, count, image)
    expected = graph_reference.borders(labels, image)
    pairs = [tuple(pair) for pair in found.pairs.tolist()]
    assert len(pairs) == len(set(pairs))
    assert set(pairs) == set(expected)
    values = np.column_stack([found.length, found.color_distance, found.middle])
    np.testing.assert_allclose(values, [expected[pair] for pair in pairs], rtol=1e-5)


def test_the_border_of_two_halves():
    image = np.zeros((4, 6, 3), np.uint8)
    labels = np.zeros((4, 6), np.int32)
    image[:, 2:], labels[:, 2:] = (10, 20, 30), 1
    found = find_borders(labels, 2, image)
    assert found.pairs.tolist() == [[0, 1]]
    assert found.length.tolist() == [4.0]
    assert found.color_distance.tolist() == [60.0]
    assert found.middle.tolist() == [[1.5, 1.5]]


def test_one_segment_has_no_border():
    found = find_borders(np.zeros((5, 4), np.int32), 1, np.zeros((5, 4), np.uint8))
    assert found.pairs.shape == (0, 2)
    assert found.length.shape == found.color_distance.shape == (0,)
    assert found.middle.shape == (0, 2)


def test_the_graph_of_an_image_is_that_of_its_parts():
    image, _, _ = segmented((12, 14, 3), seed=4)
    params = SegmentationParams(30.0, 0.0, 3)
    graph = build_segment_graph(image, params)
    labels, count = segment_image(image, params)
    assert graph.count == count
    np.testing.assert_array_equal(graph.labels, labels)
    np.testing.assert_array_equal(graph.lists.pixels, group_pixels(labels, count).pixels)
    np.testing.assert_array_equal(
        graph.borders.pairs, find_borders(labels, count, image).pairs)
    weights = edge_weights(cv2.medianBlur(image, 3))
    np.testing.assert_array_equal(graph.weights, weights)


@pytest.mark.compiled
def test_mean_colours_of_large_segments_are_not_rounded():
    image = np.full((2000, 2100), 251, np.uint8)
    labels = np.zeros(image.shape, np.int32)
    image[-5:], labels[-5:] = 1, 1
    distance = find_borders(labels, 2, image).color_distance
    np.testing.assert_allclose(distance, [750.0], rtol=1e-5)

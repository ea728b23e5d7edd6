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

"""Graph segmentation against sets of pixels."""

import cv2
import graph_reference
import numpy as np
import pytest
from real_scenes import real_scene_folder

from stereo_refine_ros.graph.pixel_graph import relative_edge_weights
from stereo_refine_ros.graph.segmentation import segment_image
from stereo_refine_ros.params import SegmentationParams


def blocky_image(shape, seed, noise=9):
    rng = np.random.default_rng(seed)
    blocks = rng.integers(0, 5, (-(-shape[0] // 4), -(-shape[1] // 4), *shape[2:])) * 50
    image = np.kron(blocks, np.ones((4, 4, *[1] * len(shape[2:])), int))[:shape[0], :shape[1]]
    return np.clip(image + rng.integers(0, noise, shape), 0, 255).astype(np.uint8)


@pytest.mark.parametrize('diagonal', [False, True])
@pytest.mark.parametrize('k, min_size', [
    (0.0, 1), (12.0, 1), (60.0, 1), (60.0, 6), (300.0, 20), (1e6, 1), (0.0, 30)])
@pytest.mark.parametrize('shape', [(11, 13, 3), (10, 9), (1, 17, 3), (15, 1)])
def test_segments_are_those_of_the_slow_version(shape, k, min_size, diagonal):
    image = blocky_image(shape, seed=shape[0])
    labels, count = segment_image(image, SegmentationParams(k, 0.0, min_size, diagonal, False))
    expected, expected_count = graph_reference.segment(image, k, min_size, 4 if diagonal else 2)
    assert labels.dtype == np.int32
    assert count == expected_count
    np.testing.assert_array_equal(labels, expected)


@pytest.mark.parametrize('seed', range(6))
def test_ties_are_decided_as_in_the_slow_version(seed):
    image = np.random.default_rng(seed).integers(0, 4, (9, 10), dtype=np.uint8) * 10
    labels, _ = segment_image(image, SegmentationParams(40.0, 0.0, 3, adapt=False))
    np.testing.assert_array_equal(labels, graph_reference.segment(image, 40.0, 3, 2)[0])


@pytest.mark.parametrize('seed', range(3))
@pytest.mark.parametrize('min_size', [1, 2, 7, 25])
def test_segments_are_large_connected_and_numbered_in_raster_order(min_size, seed):
    image = np.random.default_rng(seed).integers(0, 256, (14, 15, 3), dtype=np.uint8)
    labels, count = segment_image(image, SegmentationParams(20.0, 0.5, min_size))
    assert np.bincount(labels.reshape(-1)).min() >= min_size
    first_seen = np.unique(labels.reshape(-1), return_index=True)[1]
    assert len(first_seen) == count
    assert np.all(np.diff(first_seen) > 0)
    for label in range(count):
        parts, _ = cv2.connectedComponents((labels == label).astype(np.uint8), connectivity=4)
        assert parts == 2


def test_an_image_below_the_minimum_size_is_one_segment():
    image = np.random.default_rng(1).integers(0, 256, (4, 5), dtype=np.uint8)
    labels, count = segment_image(image, SegmentationParams(0.0, 0.0, 1000))
    assert count == 1
    assert labels.tolist() == [[0] * 5] * 4


@pytest.mark.parametrize('shape', [(1, 1), (1, 1, 3)])
def test_one_pixel_is_one_segment(shape):
    labels, count = segment_image(np.full(shape, 9, np.uint8), SegmentationParams())
    assert (labels.tolist(), count) == ([[0]], 1)


def test_two_flat_halves_are_two_segments():
    image = np.full((6, 10, 3), 40, np.uint8)
    image[:, 4:] = 90
    labels, count = segment_image(image, SegmentationParams(k=300.0, sigma=0.0, min_size=1))
    assert count == 2
    assert labels.tolist() == [[0] * 4 + [1] * 6] * 6


def test_the_image_is_blurred_first():
    image = blocky_image((12, 14, 3), seed=5, noise=40)
    blurred = cv2.GaussianBlur(image, (0, 0), 0.8)
    labels, _ = segment_image(image, SegmentationParams(80.0, 0.8, 4, adapt=False))
    expected, _ = segment_image(blurred, SegmentationParams(80.0, 0.0, 4, adapt=False))
    np.testing.assert_array_equal(labels, expected)


def noisy(image, sigma):
    noise = np.random.default_rng(5).normal(0, sigma, image.shape)
    return np.clip(np.rint(image + noise), 0, 255).astype(np.uint8)


# Each with the change of the number of segments that it may make.
VERSIONS = {
    'grey': (lambda image: cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), 0.1),
    'dark': (lambda image: np.rint(image * 0.3).astype(np.uint8), 0.1),
    'haze': (lambda image: np.rint(image * 0.5 + 100).astype(np.uint8), 0.15),
    'noise of 5': (lambda image: noisy(image, 5), 0.15),
    'noise of 10': (lambda image: noisy(image, 10), 0.3),
}


@pytest.mark.compiled
@pytest.mark.parametrize('version', VERSIONS)
@pytest.mark.parametrize('scene', ['cones', 'teddy', 'Art'])
def test_versions_of_a_scene_have_nearly_as_many_segments(scene, version):
    view = cv2.imread(str(real_scene_folder(scene) / 'left.png'))
    image = cv2.resize(view, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    make, tolerance = VERSIONS[version]
    params = SegmentationParams(min_size=15)
    count = segment_image(image, params)[1]
    assert segment_image(make(image), params)[1] == pytest.approx(count, rel=tolerance)


@pytest.mark.compiled
@pytest.mark.parametrize('version', ['dark', 'haze'])
def test_in_grey_levels_they_have_far_fewer(version):
    view = cv2.imread(str(real_scene_folder('Art') / 'left.png'))
    params = SegmentationParams(k=100.0, adapt=False)
    count = segment_image(view, params)[1]
    assert segment_image(VERSIONS[version][0](view), params)[1] < 0.75 * count


@pytest.mark.parametrize('diagonal', [False, True])
def test_segments_of_relative_weights_are_those_of_the_slow_version(diagonal):
    image = blocky_image((11, 13, 3), seed=6)
    params = SegmentationParams(150.0, 0.5, 4, diagonal, True)
    weights = relative_edge_weights(image, 0.5, 4 if diagonal else 2)
    labels, count = segment_image(image, params)
    expected, expected_count = graph_reference.segment(
        image, 150.0, 4, 4 if diagonal else 2, weights)
    assert count == expected_count
    np.testing.assert_array_equal(labels, expected)


@pytest.mark.parametrize('image', [
    np.zeros((3, 3), np.float32), np.zeros((3, 3, 4), np.uint8), np.zeros((0, 3), np.uint8)])
def test_what_is_no_image_is_refused(image):
    with pytest.raises(ValueError, match='image: expected uint8'):
        segment_image(image, SegmentationParams())

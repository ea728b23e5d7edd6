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

"""The whole method at its limits: images of nothing, of noise, of a pixel; ranges of any kind."""

import numpy as np
import pytest
from refined_pairs import assert_sound, GRIDS, RANGE, refine, views

from stereo_refine_ros.datasets.synthetic import render_scene
from stereo_refine_ros.params import MATCHERS, PRESETS, PROJECTIONS

OWN_MATCHERS = [method for method in MATCHERS if method != 'external']


def edge_cases():
    rng = np.random.default_rng(9)
    noise = rng.integers(0, 256, (2, 20, 30, 3), dtype=np.uint8)
    board = (np.indices((20, 30)).sum(0) % 2 * 255).astype(np.uint8)
    synthetic = render_scene(seed=4, height=40, width=48, num_disparities=16).pair
    return {
        'constant': (np.full((20, 30, 3), 77, np.uint8),) * 2,
        'black': (np.zeros((20, 30), np.uint8),) * 2,
        'white against black': (np.full((20, 30), 255, np.uint8), np.zeros((20, 30), np.uint8)),
        'noise': tuple(noise),
        'identical': (noise[0], noise[0]),
        'board': (board, 255 - board),
        'swapped': (synthetic.right, synthetic.left),
        '1x1': tuple(noise[:, :1, :1]),
        '1xN': tuple(noise[:, :1]),
        'Nx1': tuple(noise[:, :, :1]),
        '2x2 grey': tuple(noise[:, :2, :2, 0]),
        '8x8': tuple(noise[:, :8, :8]),
    }


@pytest.mark.parametrize('first, count', [(0, 16), (-7, 13), (3, 1), (0, 100), (60, 9)])
@pytest.mark.parametrize('name', list(edge_cases()))
@pytest.mark.parametrize('preset', PRESETS)
def test_whatever_comes_in_what_goes_out_is_sound(preset, name, first, count):
    pair = edge_cases()[name]
    for pixels in GRIDS:
        result = refine(pair, preset, matching__min_disparity=first,
                        matching__num_disparities=count, processing__refine_pixels=pixels)
        assert_sound(result, pair[0].shape[:2], first, count)


@pytest.mark.parametrize('projection', PROJECTIONS)
@pytest.mark.parametrize('name', ['noise', 'constant', '1x1', '8x8', 'swapped'])
@pytest.mark.parametrize('method', OWN_MATCHERS)
def test_every_matcher_and_projection_survives_edge_cases(method, name, projection):
    pair = edge_cases()[name]
    for pixels in GRIDS:
        result = refine(pair, matching__method=method, planes__projection=projection,
                        processing__refine_pixels=pixels)
        assert_sound(result, pair[0].shape[:2], 0, RANGE)


@pytest.mark.parametrize('height', range(1, 6))
@pytest.mark.parametrize('pixels', GRIDS)
def test_images_of_a_few_pixels(height, pixels):
    noise = np.random.default_rng(1).integers(0, 256, (2, 5, 5, 3), dtype=np.uint8)
    given = np.full((5, 5), 2.5, np.float32)
    given[::2, ::2] = np.nan
    for width in range(1, 6):
        for view in noise[:, :height, :width], noise[:, :height, :width, 0]:
            assert_sound(refine(view, processing__refine_pixels=pixels),
                         (height, width), 0, RANGE)
            for right in (view[1], None):
                result = refine((view[0], right), preliminary=given[:height, :width],
                                processing__refine_pixels=pixels)
                assert_sound(result, (height, width), 0, RANGE)
                assert result.disparity.valid.all() or width == height == 1
                np.testing.assert_array_equal(
                    result.preliminary.values, given[:height, :width])


@pytest.mark.parametrize('pixels', GRIDS)
def test_views_without_texture_are_no_reason_to_be_sure(pixels):
    plain = np.full((60, 80), 90, np.uint8)
    result = refine((plain, plain), processing__refine_pixels=pixels)
    assert_sound(result, (60, 80), 0, RANGE)
    textured = render_scene(seed=0, height=60, width=80, num_disparities=RANGE)
    known = refine(views(textured), processing__refine_pixels=pixels)
    assert result.confidence.mean() < known.confidence.mean() - 0.1


@pytest.mark.parametrize('value', [0, 255])
def test_a_constant_map_of_a_constant_image_stays_that_map(value):
    image = np.full((40, 60, 3), value, np.uint8)
    given = np.full((40, 60), 7.25, np.float32)
    for right in (image, None):
        result = refine((image, right), preliminary=given, filter__method='none')
        np.testing.assert_array_equal(result.disparity.values, given)


def test_pairs_that_are_none_are_refused():
    left, right = edge_cases()['noise']
    with pytest.raises(ValueError, match='needs the right image'):
        refine((left, None))
    with pytest.raises(ValueError, match='external'):
        refine((left, right), matching__method='external')
    with pytest.raises(ValueError, match='differ in shape'):
        refine((left, right[:-1]))

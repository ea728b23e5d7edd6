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

"""Features of the scanline matcher against what each pixel sees around it."""

import numpy as np
import pytest
import scanline_reference as slow

from stereo_refine_ros.matching.features import alike, feature_planes, flat_steps
from stereo_refine_ros.matching.vector_twins import PLANES


@pytest.mark.parametrize('shape', [(9, 13), (1, 7), (6, 1), (1, 1)])
@pytest.mark.parametrize('is_mirrored', [False, True])
def test_planes_are_gradients_and_two_censuses(shape, is_mirrored):
    grey = np.random.default_rng(1).integers(0, 256, shape, np.uint8)
    margin = 5
    out = np.full(PLANES * (grey.size + 2 * margin), 77, np.uint8)
    feature_planes(grey, is_mirrored, margin, out)
    planes = out.reshape(PLANES, -1)
    assert np.all(planes[:, :margin] == 77) and np.all(planes[:, -margin:] == 77)
    maps = planes[:, margin:-margin].reshape(PLANES, *shape)
    maps = maps[:, :, ::-1] if is_mirrored else maps
    expected = slow.features(grey)
    for y, x in np.ndindex(shape):
        slopes, bits = expected[y][x]
        assert maps[:2, y, x].tolist() == [slope + 128 for slope in slopes]
        found = np.unpackbits(maps[2:, y, x], bitorder='little')
        np.testing.assert_array_equal(found, bits)


@pytest.mark.parametrize('edge_step', [0, 1, 20, 20.5, 255, 256])
@pytest.mark.parametrize('shape', [(5, 8), (5, 8, 3), (1, 4), (4, 1, 3)])
def test_a_step_is_flat_where_no_channel_jumps(shape, edge_step):
    image = np.random.default_rng(2).integers(0, 256, shape, np.uint8)
    image[:2] = image[:2] // 12
    along, down = flat_steps(image, edge_step)
    for y, x in np.ndindex(shape[:2]):
        assert along[y, x] == (x == 0 or slow.is_flat(image, (y, x - 1), (y, x), edge_step))
        assert down[y, x] == (y == 0 or slow.is_flat(image, (y - 1, x), (y, x), edge_step))


@pytest.mark.parametrize('edge_step', [0, 1, 20, 20.5, 255, 256])
@pytest.mark.parametrize('shape', [(9, 14), (9, 14, 3), (1, 4), (4, 1, 3)])
def test_a_pixel_of_the_second_census_counts_where_no_channel_jumps(shape, edge_step):
    image = np.random.default_rng(3).integers(0, 256, shape, np.uint8)
    image[:5] = image[:5] // 12
    out = np.full(3 * shape[0] * shape[1], 77, np.uint8)
    alike(image, edge_step, out)
    maps = out.reshape(3, *shape[:2])
    expected = slow.counted(image, edge_step)
    for y, x in np.ndindex(shape[:2]):
        found = np.unpackbits(maps[:, y, x], bitorder='little')
        np.testing.assert_array_equal(found, expected[y][x][24:])

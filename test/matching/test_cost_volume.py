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

"""The truncated cost of both views against a slow version, and on hand-made rows."""

import matching_reference
import numpy as np
import pytest

from stereo_refine_ros.matching.cost_volume import truncated_cost


@pytest.mark.parametrize('is_left', [True, False])
@pytest.mark.parametrize(('min_disparity', 'num_disparities'), [(0, 4), (-3, 5), (2, 3), (0, 12)])
@pytest.mark.parametrize('shape', [(3, 9, 3), (2, 7)])
def test_cost_is_that_of_the_naive_version(shape, min_disparity, num_disparities, is_left):
    generator = np.random.default_rng(3)
    left, right = generator.integers(100, 112, (2, *shape), dtype=np.uint8)
    base, other = (left, right) if is_left else (right, left)
    volume = truncated_cost(base, other, min_disparity, num_disparities, is_left)
    expected = matching_reference.truncated_cost(
        left, right, min_disparity, num_disparities, is_left)
    assert volume.dtype == np.float32
    np.testing.assert_allclose(volume, expected, atol=1e-5)


def test_a_shifted_image_costs_nothing_at_its_shift():
    left = np.random.default_rng(4).integers(0, 256, (4, 20, 3), dtype=np.uint8)
    right = np.roll(left, -3, axis=1)
    volume = truncated_cost(left, right, 0, 6)
    assert np.all(volume[:, 4:-1, 3] == 0)
    assert np.all(truncated_cost(right, left, 0, 6, False)[:, 1:-4, 3] == 0)


def test_both_terms_are_truncated():
    black, white = np.zeros((1, 5), np.uint8), np.full((1, 5), 255, np.uint8)
    np.testing.assert_allclose(truncated_cost(black, white, 0, 1), 0.11 * 7, rtol=1e-6)
    stripes = np.array([[0, 0, 255, 255, 255]], np.uint8)
    cost = truncated_cost(black, stripes, 0, 1)[0, :, 0]
    np.testing.assert_allclose(cost, [0, 1.78, 0.77 + 1.78, 0.77, 0.77], rtol=1e-6)

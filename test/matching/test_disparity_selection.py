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

"""Winner takes all and the parabola."""

import numpy as np

from stereo_refine_ros.matching.disparity_selection import select_winners, subpixel_offsets


def test_winners_are_the_first_lowest_costs():
    volume = np.random.default_rng(7).integers(0, 4, (5, 6, 8)).astype(np.float32)
    winners = select_winners(volume)
    assert winners.dtype == np.int32
    np.testing.assert_array_equal(winners, volume.argmin(axis=2))


def test_offsets_find_the_lowest_point_of_parabolas():
    lowest = np.random.default_rng(8).uniform(1.0, 5.0, (4, 5))
    volume = ((np.arange(7) - lowest[..., np.newaxis]) ** 2).astype(np.float32)
    winners = select_winners(volume)
    np.testing.assert_allclose(winners + subpixel_offsets(volume, winners), lowest, atol=1e-5)


def test_no_offset_at_the_ends_on_plateaus_and_off_the_minimum():
    costs = [[0, 1, 2, 3], [3, 2, 1, 0], [1, 1, 1, 1], [3, 2, 1, 3]]
    volume = np.array(costs, np.float32)[np.newaxis]
    indices = np.array([[0, 3, 1, 1]], np.int32)
    assert subpixel_offsets(volume, indices).tolist() == [[0, 0, 0, 0]]

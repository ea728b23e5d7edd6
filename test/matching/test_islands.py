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

"""Islands against growing them pixel by pixel."""

import numpy as np
import pytest
from matching_reference import remove_speckles  # noqa: I100

from stereo_refine_ros.matching import islands
from stereo_refine_ros.matching.islands import without_islands


@pytest.mark.parametrize('shape', [(30, 40), (1, 60), (60, 1), (13, 17)])
@pytest.mark.parametrize('size', [0, 3, 12])
def test_small_regions_go(shape, size, monkeypatch):
    monkeypatch.setattr(islands, 'ISLANDS', shape[0] * shape[1] // max(size, 1) if size else 10**6)
    rng = np.random.default_rng(size)
    values = np.repeat(rng.integers(-24, 24, shape) / 8, 1, axis=1).astype(np.float32)
    values[rng.random(shape) < 0.3] = np.nan
    expected = remove_speckles(values, values.size // islands.ISLANDS, 1)
    for threads in (1, 2, 3):
        np.testing.assert_array_equal(without_islands(values, threads), expected)


def test_disparities_far_from_zero_are_kept():
    for level in (-5000, 5000):
        values = np.full((5, 8), level, np.float32)
        np.testing.assert_array_equal(without_islands(values), values)


def test_nothing_matched_stays_so():
    assert np.isnan(without_islands(np.full((4, 5), np.nan, np.float32))).all()

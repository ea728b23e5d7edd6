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

"""Temporal noise of two hand-made frames."""

import math

import numpy as np

from stereo_refine_ros.quality.temporal import temporal_noise, unchanged_pixels


def test_unchanged_needs_a_quiet_neighbourhood():
    previous = np.full((5, 7), 100, np.uint8)
    current = previous.copy()
    current[2, 2] = 104
    current[0, 6] = 97
    expected = np.ones((5, 7), bool)
    expected[1:4, 1:4] = False
    np.testing.assert_array_equal(unchanged_pixels(previous, current, 3), expected)


def test_unchanged_takes_colour():
    previous = np.zeros((3, 3, 3), np.uint8)
    assert unchanged_pixels(previous, previous).all()
    assert not unchanged_pixels(previous, previous + 50).any()


def test_noise_is_the_mean_change_of_counted_pixels():
    previous = np.array([[1, 2, np.nan, 4]], np.float32)
    current = np.array([[1.5, 1, 3, 9]], np.float32)
    unchanged = np.array([[True, True, True, False]])
    assert temporal_noise(previous, current, unchanged) == 0.75
    assert math.isnan(temporal_noise(previous, current, np.zeros((1, 4), bool)))

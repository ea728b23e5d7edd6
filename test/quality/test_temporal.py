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

from stereo_refine_ros.quality.temporal import (
    compare_noise, temporal_noise, unchanged_pixels)


def test_unchanged_needs_a_quiet_neighbourhood():
    previous = np.full((7, 9), 100, np.uint8)
    current = previous.copy()
    current[3, 3] = 103
    current[0, 8] = 98
    expected = np.ones((7, 9), bool)
    expected[1:6, 1:6] = False
    np.testing.assert_array_equal(unchanged_pixels(previous, current), expected)
    assert unchanged_pixels(previous, current, 3).all()


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


def test_both_maps_are_compared_over_the_same_pixels():
    nan = np.nan
    view = np.full((1, 9), 50, np.uint8)
    changed = view.copy()
    changed[0, 8] = 60  # which leaves columns 0 to 5
    before = [[1, 2, nan, 4, 5, 6, 7, 8, 9]], [[2, 2, 3, 4, 9, nan, 0, 0, 0]]
    after = [[1, 2, 3, 4, 5, 6, 7, 8, 9]], [[4, 2, 9, 4, nan, 9, 0, 0, 0]]
    found = compare_noise((view, changed), *(
        tuple(np.array(frame, np.float32) for frame in maps) for maps in (before, after)))
    # Columns 0, 1 and 3: valid in both frames of both maps.
    assert (found.preliminary, found.refined) == (1 / 3, 1.0)
    assert found.unchanged_ratio == 3 / 9


def test_a_moving_image_has_no_noise_to_measure():
    view, values = np.zeros((4, 4), np.uint8), np.ones((4, 4), np.float32)
    found = compare_noise((view, view + 9), (values, values), (values, values))
    assert found.unchanged_ratio == 0
    assert math.isnan(found.preliminary)
    assert math.isnan(found.refined)

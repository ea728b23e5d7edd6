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

"""Matching in windows of the disparities, around what half size found."""

import cv2
import numpy as np
import pytest
import scanline_reference as slow

from stereo_refine_ros.matching.scanline import scan, scan_windows
from stereo_refine_ros.matching.windows import half_range, windows
from stereo_refine_ros.types import StereoPair

NAN = np.nan


@pytest.mark.parametrize('least, count', [(0, 300), (-7, 300), (5, 257), (-300, 301), (1, 258)])
def test_half_the_range_covers_it(least, count):
    first, number = half_range(least, count)
    assert first in (least / 2, (least - 1) / 2)
    assert first + number - 1 in ((least + count - 1) / 2, (least + count) / 2)


@pytest.mark.parametrize('least', [0, -11])
def test_a_window_holds_what_is_around_it(least):
    half = np.full((4, 6), 50 + least / 2, np.float32)
    base = windows(half, (7, 11), least, 300)
    assert base.shape == (7, 11) and base.dtype == np.int32
    assert np.all(base == 100 - 16)
    half[:, 3:] += 8
    base = windows(half, (7, 11), least, 300)
    assert base[0].tolist() == [84] * 4 + [92] * 4 + [100] * 3


def test_a_window_stays_in_the_range_and_holds_the_pixel_itself():
    half = np.array([[2, 148, 148, 148]], np.float32)
    base = windows(half, (2, 8), 0, 300)
    # From 4 and 296 on, 3 inside.
    assert base[0].tolist() == [1, 1, 267, 267, 268, 268, 268, 268]


def test_what_half_size_did_not_match_takes_the_farther_neighbour():
    half = np.array([[NAN, 40, NAN, NAN, NAN, NAN, 90, NAN], [NAN] * 8], np.float32)
    base = windows(np.repeat(half, 3, axis=0), (12, 16), 0, 300)
    assert base[0].tolist() == [64] * 10 + [77] * 2 + [151] * 2 + [164] * 2
    np.testing.assert_array_equal(base, np.repeat(base[:1], 12, axis=0))
    assert np.all(windows(np.full((2, 3), NAN, np.float32), (3, 5), -20, 300) == 0)


@pytest.mark.parametrize('steps', [3, 40])
def test_paths_go_from_window_to_window(steps):
    rng = np.random.default_rng(steps)
    views = [rng.integers(0, 256, (9, 26), np.uint8) for _ in range(2)]
    views[1][:, :-4] = views[0][:, 4:]
    base = np.kron(rng.integers(0, steps, (3, 7)), np.ones((3, 4), int))[:, :26].astype(np.int32)
    planes = [slow.features(grey) for grey in views]
    costs = slow.cost_volume(
        *planes, slow.counted(views[0], 20),
        lambda y, x: range(base[y, x] - 12, base[y, x] - 12 + 32))
    expected = slow.finish(slow.path_sums(views[0], costs, 20), costs, (9, 26))
    found = scan_windows(StereoPair(*views), -12, 32, base, 1, 20)
    np.testing.assert_allclose(found.disparity, expected[0], rtol=1e-6)
    np.testing.assert_allclose(found.uniqueness, expected[1], rtol=1e-6)
    np.testing.assert_array_equal(found.right, expected[2])


@pytest.mark.compiled
@pytest.mark.parametrize('least, count, shift', [(0, 300, 277), (-520, 600, -301), (3, 1200, 900)])
def test_any_range_finds_the_shift_and_stays_inside(least, count, shift):
    rng = np.random.default_rng(1)
    size = abs(shift) + 90
    wide = cv2.GaussianBlur(rng.integers(0, 256, (40, size + abs(shift)), np.uint8), (0, 0), 2)
    views = [np.ascontiguousarray(view) for view in (wide[:, :size], wide[:, abs(shift):])]
    pair = StereoPair(*(views if shift > 0 else views[::-1]))
    found = scan(pair, least, count)
    seen = found.disparity[:, shift:] if shift > 0 else found.disparity[:, :shift]
    assert np.mean(np.abs(seen - shift) < 0.75) > 0.9
    valid = found.disparity[np.isfinite(found.disparity)]
    assert least <= valid.min() <= valid.max() < least + count
    again = scan(pair, least, count, 3)
    np.testing.assert_array_equal(again.disparity, found.disparity)

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

"""The benchmark of segments, on pictures whose answer is known."""

import numpy as np
import pytest
import segments
from stereo_refine_ros.datasets.scene import Scene
from stereo_refine_ros.params import SegmentationParams
from stereo_refine_ros.types import StereoPair

PARAMS = SegmentationParams(sigma=0.0, min_size=10)


def two_planes(monkeypatch, border):
    """Return what is measured where the colour changes at column 30, the plane at `border`."""
    image = np.full((40, 60), 50, np.uint8)
    image[:, 30:] = 150
    truth = np.full((40, 60), 5, np.float32)
    truth[:, border:] = 20
    scene = Scene(name='halves', pair=StereoPair(image, image), truth=truth, scale=1,
                  num_disparities=32, masks={}, geometry=None, truth_right=None)
    monkeypatch.setattr(segments, 'load_scene', lambda name, data: scene)
    return segments.measure(lambda each: each, 'halves', None, False, PARAMS)


def test_segments_that_are_planes_are_right_from_truth_and_from_matches(monkeypatch):
    assert two_planes(monkeypatch, 30) == (2, 0.0, 0.0, 0.0)


def test_what_lies_on_another_plane_than_the_rest_of_its_segment_is_counted(monkeypatch):
    count, under, small, noisy = two_planes(monkeypatch, 33)
    assert (count, small) == (2, 0.0)
    assert under == noisy == pytest.approx(100 * 3 / 60)


def test_noise_does_not_change_the_picture_it_is_given():
    image = np.full((5, 6), 250, np.uint8)
    assert segments.VERSIONS['noise of 10'](image).max() == 255
    assert image.tolist() == [[250] * 6] * 5

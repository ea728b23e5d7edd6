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

"""The row offset of a real car over its frames: one offset, found again and again."""

import cv2
import numpy as np
import pytest
from real_scenes import real_scene_folder

from stereo_refine_ros.rectification import measure_row_offset, RowOffsetTracker

pytestmark = pytest.mark.compiled


def test_car_has_one_offset_and_its_picture_is_not_shaken():
    """Compare SIFT's matches in three frames: -0.12 to -0.23 px and a twist of 6.0 to 6.9."""
    folder = real_scene_folder('../sequences/kitti_odometry_excerpt_1')
    tracker, used, measured = RowOffsetTracker(), [], []
    for path in sorted((folder / 'left').glob('*.png')):
        left, right = (cv2.imread(str(folder / side / path.name), cv2.IMREAD_GRAYSCALE)
                       for side in ('left', 'right'))
        offset = measure_row_offset(left, right, 0, 96)
        measured.append(offset.terms)
        used.append(tracker.update(offset))
    assert len(used) == 51
    assert np.std(measured, axis=0).max() <= 0.8
    assert np.mean(measured, axis=0) == pytest.approx([-0.19, 0, 0, 6.7], abs=0.2)
    assert sum(a.terms != b.terms for a, b in zip(used, used[1:], strict=False)) <= 3
    assert used[-1].terms == pytest.approx([-0.19, 0, 0, 6.7], abs=0.3)

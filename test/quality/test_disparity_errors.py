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

"""Bad-pixel percentages and average error on hand-made maps."""

import math

import numpy as np
import pytest

from stereo_refine_ros.quality.disparity_errors import bad_percent, measure_errors

NAN = np.nan
TRUTH = np.array([[1, 2, 3, 4, NAN], [5, 6, 7, 8, 9]], np.float32)
VALUES = np.array([[1.5, 3, 5, 4, 40], [NAN, 6.25, 9.5, 8, 9]], np.float32)


def test_errors_by_hand():
    errors = measure_errors(VALUES, TRUTH)
    # Nine known pixels; errors .5, 1, 2, 0, hole, .25, 2.5, 0, 0: thresholds are strict.
    assert errors.bad_0_5 == pytest.approx(100 * 4 / 9)
    assert errors.bad_1_0 == pytest.approx(100 * 3 / 9)
    assert errors.bad_2_0 == pytest.approx(100 * 2 / 9)
    assert errors.bad_3_0 == pytest.approx(100 / 9)  # the hole
    assert errors.avg_error == pytest.approx((0.5 + 1 + 2 + 0.25 + 2.5) / 8)
    assert errors.density == pytest.approx(8 / 9)


def test_mask_limits_the_pixels():
    mask = np.zeros(TRUTH.shape, bool)
    mask[0] = True
    assert bad_percent(VALUES, TRUTH, 1.0, mask) == pytest.approx(25)
    assert measure_errors(VALUES, TRUTH, mask).avg_error == pytest.approx(3.5 / 4)


def test_a_hole_is_bad_and_has_no_error():
    errors = measure_errors(np.full(TRUTH.shape, NAN, np.float32), TRUTH)
    assert (errors.bad_0_5, errors.bad_2_0, errors.density) == (100, 100, 0)
    assert math.isnan(errors.avg_error)


def test_nothing_known_gives_nan():
    errors = measure_errors(VALUES, np.full(TRUTH.shape, NAN, np.float32))
    assert math.isnan(errors.bad_1_0)
    assert math.isnan(errors.density)


def test_shapes_must_agree():
    with pytest.raises(ValueError, match='one shape'):
        measure_errors(VALUES, TRUTH[:, :3])

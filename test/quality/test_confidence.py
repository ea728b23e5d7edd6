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

"""Tests of the measures of a confidence, on a few pixels worked out by hand."""

import math

import numpy as np
import pytest
from stereo_refine_ros.quality.confidence import (
    area, best_area, density_at_error, judged_pixels, measure_confidence, reliability,
    sparsification_curve)

SURE = np.array([0.9, 0.5, 0.7, 0.1], np.float32)
WRONG = np.array([False, True, False, True])


def test_the_least_sure_pixels_go_first():
    # Surest first: right (0.9), right (0.7), wrong (0.5), wrong (0.1).
    assert sparsification_curve(SURE, WRONG).tolist() == [0, 0, 1 / 3, 2 / 4]


def test_pixels_of_one_confidence_share_their_errors():
    # The middle two are alike, one of them wrong: half a wrong pixel each.
    curve = sparsification_curve([0.9, 0.5, 0.5, 0.1], [False, True, False, True])
    assert curve == pytest.approx([0, 0.5 / 2, 1 / 3, 2 / 4])
    same = sparsification_curve([0.9, 0.5, 0.5, 0.1], [False, False, True, True])
    assert curve.tolist() == same.tolist()


def test_a_constant_confidence_has_the_area_of_the_share_of_wrong_pixels():
    wrong = np.arange(100) < 30
    assert area(sparsification_curve(np.full(100, 0.4), wrong)) == pytest.approx(0.3)


@pytest.mark.parametrize(('wrong', 'count', 'expected'), [
    (0, 5, 0.0), (2, 4, (1 / 3 + 2 / 4) / 4), (3, 3, 1.0), (0, 0, math.nan)])
def test_best_area(wrong, count, expected):
    assert best_area(wrong, count) == pytest.approx(expected, nan_ok=True)


def test_the_best_order_has_the_best_area_and_the_worst_a_larger_one():
    wrong = np.arange(1000) % 7 == 0
    right_first = area(sparsification_curve(1.0 - wrong, wrong))
    # Within one confidence the errors are spread: all right first, all wrong last.
    assert right_first == pytest.approx(best_area(143, 1000))
    assert area(sparsification_curve(wrong.astype(float), wrong)) > 2 * right_first


def test_the_best_area_of_many_pixels_is_its_closed_form():
    error = 0.2
    assert best_area(20_000, 100_000) == pytest.approx(
        error + (1 - error) * math.log(1 - error), abs=1e-4)


def test_density_at_error():
    curve = np.array([0.0, 0.1, 0.05, 0.2])
    assert density_at_error(curve, 0.05) == 0.75
    assert density_at_error(curve + 0.2, 0.05) == 0.0
    assert math.isnan(density_at_error(np.zeros(0)))


def test_reliability_compares_what_is_promised_with_what_is_kept():
    bins = reliability([0.05, 0.85, 0.88, 0.95, 1.0], [True, False, True, False, False])
    assert bins.share.tolist() == [0.2, 0, 0, 0, 0, 0, 0, 0, 0.4, 0.4]
    assert bins.predicted[[0, 8, 9]] == pytest.approx([0.05, 0.865, 0.975])
    assert bins.observed[[0, 8, 9]].tolist() == [0.0, 0.5, 1.0]
    assert np.isnan(bins.observed[1:8]).all()
    assert bins.calibration_error == pytest.approx(0.2 * 0.05 + 0.4 * 0.365 + 0.4 * 0.025)


def test_a_true_promise_has_no_calibration_error():
    assert reliability([0.75] * 4, [False, False, False, True]).calibration_error == 0.0
    assert math.isnan(reliability([], []).calibration_error)


def test_measure_confidence_looks_at_known_pixels_only_and_a_hole_is_wrong():
    truth = np.array([[10, 10, np.nan], [10, 10, 10]], np.float32)
    values = np.array([[10, 12, 99], [10.5, np.nan, 11]], np.float32)
    confidence = np.array([[0.95, 0.9, 1.0], [0.5, 0.2, np.nan]], np.float32)
    found = measure_confidence(confidence, values, truth)
    # Surest first: .95 right, .9 wrong, .5 right, .2 wrong (a hole), 0 right (1 px is not more).
    assert found.confidence_area == pytest.approx((0 + 1 / 2 + 1 / 3 + 2 / 4 + 2 / 5) / 5)
    assert found.confidence_area_best == pytest.approx((1 / 4 + 2 / 5) / 5)
    assert (found.sure_share, found.sure_wrong, found.density_at_5) == (0.4, 0.5, 0.2)
    assert found.calibration_error == pytest.approx(
        (2 * abs(0.5 - 0.925) + 0.5 + 0.2 + 1.0) / 5)


def test_threshold_and_mask():
    truth = np.zeros((1, 4), np.float32)
    values = np.array([[0, 2, 4, 0]], np.float32)
    sure, wrong = judged_pixels(np.full((1, 4), 0.5, np.float32), values, truth, 3.0,
                                np.array([[True, True, True, False]]))
    assert sure.tolist() == [0.5] * 3
    assert wrong.tolist() == [False, False, True]


def test_without_known_truth_nothing_is_measured():
    empty = np.full((2, 2), np.nan, np.float32)
    found = measure_confidence(empty, empty, empty)
    assert all(map(math.isnan, vars(found).values()))


def test_without_sure_pixels_none_of_them_is_wrong():
    zero = np.zeros((2, 2), np.float32)
    found = measure_confidence(zero, zero, zero)
    assert found.sure_share == 0.0
    assert math.isnan(found.sure_wrong)


def test_shapes_that_differ_are_refused():
    with pytest.raises(ValueError, match=r'confidence \(0, 0\), disparity \(2, 2\)'):
        measure_confidence(np.zeros((0, 0), np.float32), *[np.zeros((2, 2), np.float32)] * 2)

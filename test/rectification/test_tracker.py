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

"""The offset in use over frames: still on a still camera, and right again after a knock."""

import numpy as np
import pytest

from stereo_refine_ros.rectification import RowOffset, RowOffsetTracker


def measured(offset_px, rng=None, sigma=0.05, tilt_px=0.0):
    shake = 0.0 if rng is None else rng.normal(0, sigma)
    return RowOffset(offset_px + shake, tilt_px, points=100)


def test_first_frame_counts():
    assert RowOffsetTracker().update(measured(1.0)).offset_px == 1.0


def test_settled_offset_does_not_move():
    rng, tracker = np.random.default_rng(0), RowOffsetTracker()
    used = [tracker.update(measured(1.0, rng)) for _ in range(200)]
    assert len(set(used)) <= 3
    assert len(set(used[20:])) == 1
    assert used[-1].offset_px == pytest.approx(1.0, abs=0.12)


def test_no_offset_stays_exactly_none():
    rng, tracker = np.random.default_rng(1), RowOffsetTracker()
    assert all(tracker.update(measured(0.05, rng)).is_zero for _ in range(300))


def test_offset_near_the_limit_does_not_come_and_go():
    rng, tracker = np.random.default_rng(2), RowOffsetTracker()
    used = [tracker.update(measured(0.2, rng)).is_zero for _ in range(300)]
    assert np.count_nonzero(np.diff(used[20:])) <= 1


@pytest.mark.parametrize('after', [RowOffset(2.0, points=90), RowOffset(1.0, 2.2, points=90),
                                   RowOffset(points=90)], ids=str)
def test_knock_is_taken_over_after_three_frames(after):
    tracker = RowOffsetTracker()
    for _ in range(40):
        before = tracker.update(measured(1.0))
    assert [tracker.update(after) for _ in range(2)] == [before, before]
    assert tracker.update(after).terms == after.terms


def test_single_wrong_frames_change_nothing():
    tracker = RowOffsetTracker()
    used = {tracker.update(measured(3.0 if frame % 4 == 3 else 1.0)) for frame in range(80)}
    assert used == {RowOffset(1.0, points=100)}


def test_slow_drift_is_followed():
    tracker = RowOffsetTracker()
    for frame in range(300):
        used = tracker.update(measured(1.0 + 0.005 * frame))
    assert used.offset_px == pytest.approx(2.5, abs=0.2)


def test_frames_without_evidence_change_nothing():
    tracker = RowOffsetTracker()
    assert tracker.update(RowOffset()).is_zero
    used = tracker.update(measured(1.0))
    assert all(tracker.update(RowOffset()) == used for _ in range(50))


def test_offset_that_goes_away_ends_the_warp():
    tracker = RowOffsetTracker()
    for _ in range(30):
        tracker.update(measured(0.3))
    for _ in range(30):
        used = tracker.update(measured(0.0))
    assert used.is_zero

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

"""A frame and its ground truth, whichever comes first; one without the other."""

import queue

import pytest
from stereo_msgs.msg import DisparityImage

from stereo_refine_ros.node import truth
from stereo_refine_ros.node.truth import MOST_WAITING, TruthDesk

pytestmark = pytest.mark.ros


class Desk:
    """A desk that measures into a queue."""

    def __init__(self, expected=True):
        self.measured, self.errors, self.expected = queue.Queue(), [], expected
        self.desk = TruthDesk(
            lambda frame, found: self.measured.put((frame, found)), lambda: self.expected,
            self.errors.append)

    def next(self):  # noqa: A003
        return self.measured.get(timeout=10)


@pytest.mark.parametrize('truth_first', [True, False])
def test_frame_and_truth_meet_in_either_order(truth_first):
    rig, message = Desk(), DisparityImage(f=3.0)
    if truth_first:
        rig.desk.add_truth(5, message)
    rig.desk.add_frame(5, 'frame')
    if not truth_first:
        rig.desk.add_truth(5, message)
    assert rig.next() == ('frame', message)


def test_where_nobody_publishes_truth_nobody_waits(monkeypatch):
    monkeypatch.setattr(truth, 'WAIT_S', 3600.0)
    rig = Desk(expected=False)
    rig.desk.add_frame(5, 'frame')
    assert rig.next() == ('frame', None)


def test_waiting_ends(monkeypatch):
    monkeypatch.setattr(truth, 'WAIT_S', 0.01)
    rig = Desk()
    rig.desk.add_truth(4, DisparityImage())
    rig.desk.add_frame(5, 'frame')
    assert rig.next() == ('frame', None)


def test_few_wait_and_the_order_stays(monkeypatch):
    monkeypatch.setattr(truth, 'WAIT_S', 3600.0)
    rig, message = Desk(), DisparityImage()
    for stamp in range(MOST_WAITING + 1):
        rig.desk.add_frame(stamp, stamp)
    assert rig.next() == (0, None)
    rig.desk.add_truth(2, message)
    rig.desk.add_truth(1, message)
    assert [rig.next()[0], rig.next()[0]] == [1, 2]


def test_a_failing_measurement_costs_itself():
    errors, measured = [], queue.Queue()
    desk = TruthDesk(lambda frame, _: measured.put(1 / frame), lambda: False, errors.append)
    desk.add_frame(1, 0)
    desk.add_frame(2, 4)
    assert measured.get(timeout=10) == 0.25
    assert isinstance(errors[0], ZeroDivisionError)


def test_it_ends_while_a_frame_waits(monkeypatch):
    monkeypatch.setattr(truth, 'WAIT_S', 3600.0)
    rig = Desk()
    rig.desk.add_frame(5, 'frame')
    assert rig.desk.stop(10.0)

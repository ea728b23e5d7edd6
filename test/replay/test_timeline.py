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

"""When messages are due: speed, pauses and steps, by a clock of the test's own."""

import pytest

from stereo_refine_ros.replay.timeline import Timeline

NS = 1_000_000_000


class Clock:
    def __init__(self):  # noqa: CNL100
        self.now = 50.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


@pytest.mark.parametrize('speed', [0.5, 1.0, 4.0])
def test_messages_are_due_at_the_speed(clock, speed):
    timeline = Timeline(speed, now=clock)
    timeline.begin(1000 * NS)
    assert timeline.wait_s(1000 * NS) == 0
    assert timeline.wait_s(1002 * NS) == pytest.approx(2 / speed)
    clock.now += 1
    assert timeline.position_ns == pytest.approx((1000 + speed) * NS)
    assert timeline.wait_s(1000 * NS) == 0  # late ones go at once


def test_a_pause_stops_the_time_and_going_on_continues_it(clock):
    timeline = Timeline(2.0, now=clock)
    timeline.begin(100 * NS)
    clock.now += 1
    timeline.toggle()
    clock.now += 60
    assert timeline.position_ns == 102 * NS
    assert timeline.wait_s(103 * NS) == float('inf')
    timeline.toggle()
    assert timeline.wait_s(103 * NS) == pytest.approx(0.5)


def test_steps_let_one_message_each_out(clock):
    timeline = Timeline(1.0, is_paused=True, now=clock)
    timeline.begin(100 * NS)
    assert timeline.wait_s(100 * NS) == float('inf')
    timeline.step()
    assert timeline.wait_s(100 * NS) == 0
    timeline.passed(100 * NS)
    assert timeline.wait_s(105 * NS) == float('inf')
    timeline.step()
    timeline.step()
    timeline.passed(105 * NS)
    assert (timeline.position_ns, timeline.wait_s(106 * NS)) == (105 * NS, 0)
    timeline.toggle()  # going on from where the last step was; unused steps are forgotten
    assert timeline.wait_s(106 * NS) == pytest.approx(1)
    timeline.step()  # nothing to step while it runs
    timeline.toggle()
    assert timeline.wait_s(106 * NS) == float('inf')


def test_speed_changes_by_a_tenth_without_a_jump(clock):
    timeline = Timeline(1.0, now=clock)
    timeline.begin(10 * NS)
    clock.now += 2
    timeline.change_speed(True)
    assert timeline.position_ns == 12 * NS
    assert timeline.speed == pytest.approx(1.1)
    clock.now += 1
    assert timeline.position_ns == pytest.approx(13.1 * NS)
    timeline.change_speed(False)
    assert timeline.speed == pytest.approx(1.0)
    for _ in range(200):
        timeline.change_speed(False)
    assert timeline.speed == 0.01


def test_a_loop_goes_back(clock):
    timeline = Timeline(1.0, now=clock)
    timeline.begin(10 * NS)
    clock.now += 5
    timeline.begin(10 * NS)
    assert timeline.position_ns == 10 * NS

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

"""Counters that account for every pair, the throttle of the log, numbers as text."""

import math

import numpy as np
import pytest

from stereo_refine_ros.messages.metrics import decimal
from stereo_refine_ros.node.counters import Counts, FrameCounters, Throttle


def test_every_pair_is_accounted_for():
    counters = FrameCounters(clock=iter(np.arange(100) * 0.1).__next__)
    for _ in range(5):
        counters.received()
    counters.superseded()
    counters.refused('step')
    counters.published()
    counters.published()
    assert counters.counts() == Counts(
        received=5, published=2, superseded=1, in_flight=1, refused={'step': 1})
    assert counters.fps() == pytest.approx(10.0)


def test_the_throttle_lets_one_through_per_period_and_key():
    now = [0.0]
    throttle = Throttle(10.0, lambda: now[0])
    assert [throttle.allows('a'), throttle.allows('a'), throttle.allows('b')] == [
        True, False, True]
    now[0] = 10.0
    assert throttle.allows('a')


@pytest.mark.parametrize('value,text', [
    (0, '0'), (12, '12'), (3.0, '3'), (0.1, '0.1'), (1e-7, '0.0000001'), (-2.5, '-2.5'),
    (math.nan, 'nan'), (math.inf, 'inf'), (1e20, '100000000000000000000.0')])
def test_decimal_strings(value, text):
    assert decimal(value) == text
    assert float(decimal(value)) == value or math.isnan(value)

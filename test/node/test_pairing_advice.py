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

"""Why pairs are not complete: loss, slowness, lag and stamps are told apart."""

import pytest

from stereo_refine_ros.node.pairing_advice import explain_unmatched
from stereo_refine_ros.pairing import Pairing

pytestmark = pytest.mark.ros
MS = 1_000_000


def said(left, right, rates, queue_size=10):
    """Explain a pairing that got these stamps in milliseconds."""
    pairing = Pairing(('left', 'right'), queue_size=queue_size)
    for name, stamps in (('left', left), ('right', right)):
        for stamp in stamps:
            pairing.add(name, round(stamp * MS), None, 0.0)
    return explain_unmatched(pairing, dict(zip(('left', 'right'), rates, strict=True)))


@pytest.mark.parametrize('left,right,rates,words', [
    ([33], [], (30, 0), 'right never came: check its name'),
    ([33, 66], [33], (30, 15), 'right delivers 15 of 30 a second: its camera is slow, or'),
    ([33], [33, 66], (9, 30), 'left delivers 9 of 30 a second'),
    ([33, 66, 99], [37, 70, 103], (30, 30),
     'stamps of one instant differ by 4.0 ms: set sync.approximate to true and sync.slop to '
     '0.0060 or more'),
    ([1033, 1066], [33, 66], (30, 30), 'right lags by 1000 ms: its source is too slow'),
    ([33, 99], [66, 132], (15, 15), 'messages are lost on the way (left 15, right 15 a second')])
def test_each_cause_has_its_words(left, right, rates, words):
    assert words in said(left, right, rates)

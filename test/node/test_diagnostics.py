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

"""What /diagnostics says: levels that mean something, and what to do."""

from diagnostic_msgs.msg import DiagnosticStatus
import pytest

from stereo_refine_ros.health_advice import Advice, Level
from stereo_refine_ros.node.counters import Counts
from stereo_refine_ros.node.diagnostics import (
    ADVICE, assess, diagnostic_status, frame_status, Health)

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
BEFORE = Counts(received=100, published=100)


@pytest.mark.parametrize('fields,level,text', [
    ({'ready': False}, OK, 'compiling'),
    ({'listening': False}, OK, 'idle'),
    ({}, OK, 'refining at 29.5'),
    ({'silent': ('right/image_rect',), 'silent_why': ('nobody publishes it',)}, ERROR,
     'no input on right/image_rect: nobody publishes it'),
    ({'feedback': ('/disparity is both',)}, ERROR, '/disparity is both'),
    ({'notes': ('disparity comes without depth',)}, WARN, 'without depth'),
    ({'advice': (Advice('gain', Level.WARN, 'too bright'),)}, WARN, 'too bright'),
    ({'advice': (Advice('black', Level.ERROR, 'no light'),)}, ERROR, 'no light'),
    ({'incompatible': ('left/image_rect',)}, ERROR, 'qos_overrides'),
    ({'now': Counts(received=101, published=100, failures=1)}, ERROR, 'refinement failed 1'),
    ({'now': Counts(received=101, published=101, degraded=1)}, ERROR, 'preliminary'),
    ({'now': Counts(received=101, published=100, refused={'step': 1})}, WARN, ADVICE['step']),
    ({'unmatched': 3, 'unmatched_why': 'right lags'}, WARN, '3 pairs unmatched: right lags'),
    ({'now': Counts(received=130, published=120, superseded=10)}, WARN, 'too slow: 10 of 30'),
    ({'now': Counts(received=130, published=129, superseded=1)}, OK, 'refining'),
    ({'now': Counts(received=130, published=120, superseded=10), 'compiling': True}, OK,
     'compiling kernels for other parameters'),
    ({'unmatched': 3, 'unmatched_why': 'right lags', 'compiling': True}, WARN, 'right lags'),
    ({'valid_ratio': 0.12}, WARN, 'only 12 %'),
])
def test_levels(fields, level, text):
    health = Health(**{'listening': True, 'now': BEFORE, 'before': BEFORE, 'fps': 29.5,
                       'valid_ratio': 0.9, **fields})
    found, message = assess(health)
    assert found == level
    assert text in message


def test_what_was_wrong_before_is_forgotten():
    counts = Counts(received=9, published=2, superseded=3, failures=1, refused={'step': 4})
    assert assess(Health(listening=True, now=counts, before=counts, unmatched=5,
                         unmatched_before=5, valid_ratio=0.9))[0] == OK


def test_the_status_holds_every_counter():
    counts = Counts(received=9, published=2, superseded=3, refused={'step': 3, 'encoding': 1})
    status = diagnostic_status('/refine_node: stereo refinement', 'left_optical', Health(
        listening=True, now=counts, before=counts, valid_ratio=0.5, fps=12.5))
    values = {item.key: item.value for item in status.values}
    assert (status.name, status.hardware_id) == (
        '/refine_node: stereo refinement', 'left_optical')
    assert values['refused.step'] == '3' and values['refused.encoding'] == '1'
    assert values['pairs_refused'] == '4' and values['fps'] == '12.5'
    assert int(values['pairs_received']) == sum(int(values[f'pairs_{name}']) for name in (
        'published', 'superseded', 'refused', 'in_flight'))


@pytest.mark.parametrize('degraded,advice,level,text', [
    (False, (), OK, 'refined'), (False, (Advice('a', Level.WARN, 'w'),), WARN, 'w'),
    (False, (Advice('b', Level.ERROR, 'e'), Advice('a', Level.WARN, 'w')), ERROR, 'e; w'),
    (True, (), ERROR, 'refinement failed: disparity is the preliminary one')])
def test_the_status_of_a_frame(degraded, advice, level, text):
    assert frame_status(degraded, advice) == (level, text)

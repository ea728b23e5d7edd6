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

"""The worker's side: what goes out for a frame, what happens when refining fails."""

from dataclasses import dataclass, field
import math

from harness import stereo_messages, textured_pair
import numpy as np
import pytest

from stereo_refine_ros.encodings import BadMessage
from stereo_refine_ros.messages.metrics import decimal
from stereo_refine_ros.node.frame import Calibration, check_frame
from stereo_refine_ros.node.ledger import Counts, Ledger, Throttle
from stereo_refine_ros.node.processing import FrameProcessor, Surroundings
from stereo_refine_ros.pairing import MessageSet
from stereo_refine_ros.params import load_preset
from stereo_refine_ros.pipeline import StereoRefiner


@dataclass
class Outlet:
    wanted: set = field(default_factory=lambda: {'metrics'})
    sent: list = field(default_factory=list)

    def wants(self, topic):
        return topic in self.wanted

    def publish(self, topic, message):
        self.sent.append((topic, message))

    def last(self, topic):
        return [message for name, message in self.sent if name == topic][-1]


class Rig:
    """A processor with stand-ins around it."""

    def __init__(self, make_refiner=StereoRefiner, **values):
        self.outlet, self.ledger = Outlet(), Ledger()
        self.errors, self.refusals, self.warnings = [], [], []
        self.params = load_preset('live', {'matching.num_disparities': 16, **values})
        self.processor = FrameProcessor(Surroundings(
            lambda: self.params, self.outlet, self.ledger, lambda header: 1.0, lambda: 0,
            self.refusals.append, self.errors.append,
            lambda key, text: self.warnings.append(key), self.later), make_refiner)

    def later(self, task):
        try:
            task()
        except Exception as error:
            self.errors.append(error)

    def feed(self, frame):
        self.ledger.received()
        self.processor.process(frame)


class Broken(StereoRefiner):
    def process(self, *args, **kwargs):
        raise RuntimeError('kernel failed')


def frame(stamp=1):
    messages = stereo_messages(*textured_pair(), stamp)
    return check_frame(MessageSet(stamp, messages), Calibration())


def figures(message):
    return {item.key: float(item.value) for item in message.status[0].values}


def test_values_are_those_of_the_core():
    rig = Rig()
    rig.feed(frame())
    expected = StereoRefiner(rig.params).process(*textured_pair()).disparity.values
    message = rig.outlet.last('disparity')
    sent = np.frombuffer(message.image.data, np.float32).reshape(expected.shape)
    np.testing.assert_array_equal(sent, np.nan_to_num(expected, nan=-1.0))
    assert [topic for topic, _ in rig.outlet.sent] == ['disparity', 'metrics']
    assert figures(rig.outlet.last('metrics'))['degraded'] == 0


def test_metrics_are_made_only_for_a_listener():
    rig = Rig()
    rig.outlet.wanted.clear()
    rig.feed(frame())
    assert [topic for topic, _ in rig.outlet.sent] == ['disparity']


def test_repeated_failure_publishes_the_preliminary_disparity():
    rig = Rig(Broken)
    for stamp in (1, 2):
        with pytest.raises(RuntimeError):
            rig.feed(frame(stamp))
    assert rig.outlet.sent == []
    rig.feed(frame(3))
    expected = StereoRefiner(rig.params).process(*textured_pair()).preliminary.values
    sent = np.frombuffer(rig.outlet.last('disparity').image.data, np.float32)
    np.testing.assert_array_equal(sent, np.nan_to_num(expected, nan=-1.0).ravel())
    status = rig.outlet.last('metrics').status[0]
    assert figures(rig.outlet.last('metrics'))['degraded'] == 1
    assert status.level == b'\x02' and 'preliminary' in status.message
    assert [str(error) for error in rig.errors] == ['kernel failed']
    assert rig.ledger.counts().degraded == 1


def test_refining_is_tried_again_after_failures():
    broken = True

    def make(params):
        class Sometimes(StereoRefiner):
            def process(self, *args, **kwargs):
                if broken:
                    raise RuntimeError('kernel failed')
                return super().process(*args, **kwargs)
        return Sometimes(params)

    rig = Rig(make)
    for stamp in (1, 2):
        with pytest.raises(RuntimeError):
            rig.feed(frame(stamp))
    rig.feed(frame(3))
    broken = False
    rig.feed(frame(4))
    assert figures(rig.outlet.last('metrics'))['degraded'] == 0


def test_a_failing_view_does_not_cost_the_disparity(monkeypatch):
    rig = Rig()
    rig.outlet.wanted = {'disparity/color', 'metrics'}
    monkeypatch.setattr('stereo_refine_ros.node.processing.color_map', lambda _: 1 / 0)
    rig.feed(frame())
    assert [topic for topic, _ in rig.outlet.sent] == ['disparity']
    assert isinstance(rig.errors[0], ZeroDivisionError)
    assert rig.ledger.counts().published == 1


def test_one_refiner_serves_frames_until_parameters_change():
    made = []

    def make(params):
        made.append(params)
        return StereoRefiner(params)

    rig = Rig(make)
    rig.feed(frame(1))
    rig.feed(frame(2))
    rig.params = rig.params.updated({'matching.num_disparities': 32})
    rig.feed(frame(3))
    assert [p.matching.num_disparities for p in made] == [16, 32]
    assert rig.outlet.last('disparity').max_disparity == 31.0


def test_mixed_color_and_grey_are_matched_in_grey():
    messages = stereo_messages(*textured_pair(), 1)
    messages['right/image_rect'] = stereo_messages(
        *textured_pair(color=False), 1)['right/image_rect']
    rig = Rig()
    rig.feed(check_frame(MessageSet(1, messages), Calibration()))
    assert rig.ledger.counts().published == 1


def test_sizes_that_differ_are_refused():
    messages = stereo_messages(*textured_pair(), 1)
    messages['right/image_rect'] = stereo_messages(
        *textured_pair(width=100), 1)['right/image_rect']
    with pytest.raises(BadMessage) as error:
        check_frame(MessageSet(1, messages), Calibration())
    assert error.value.reason == 'size_differs'


@pytest.mark.parametrize('method', ['sgbm', 'external'])
def test_warm_up_publishes_nothing(method):
    rig = Rig(**{'matching.method': method})
    rig.processor.warm_up()
    assert rig.outlet.sent == [] and rig.ledger.counts() == Counts()


def test_the_ledger_accounts_for_every_pair():
    ledger = Ledger(clock=iter(np.arange(100) * 0.1).__next__)
    for _ in range(5):
        ledger.received()
    ledger.superseded()
    ledger.refused('step')
    ledger.published()
    ledger.published()
    counts = ledger.counts()
    assert counts == Counts(received=5, published=2, superseded=1, in_flight=1,
                            refused={'step': 1})
    assert ledger.fps() == pytest.approx(10.0)


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

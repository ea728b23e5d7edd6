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

"""The core inside the node: one refiner while parameters stay, a fallback while it fails."""

from harness import stereo_messages, textured_pair
import numpy as np
import pytest

from stereo_refine_ros.encodings import BadMessage
from stereo_refine_ros.node.calibration import Calibration
from stereo_refine_ros.node.frame import check_frame, decode_frame
from stereo_refine_ros.node.frame_refiner import FAILURES_BEFORE_FALLBACK, FrameRefiner
from stereo_refine_ros.pairing import MessageSet
from stereo_refine_ros.params import load_preset
from stereo_refine_ros.pipeline import StereoRefiner
from stereo_refine_ros.types import StereoPair

PAIR = StereoPair(*textured_pair())
PARAMS = load_preset('live', {'matching.num_disparities': 16})


class Broken(StereoRefiner):
    is_broken = True

    def process(self, *args, **kwargs):
        if self.is_broken:
            raise RuntimeError('kernel failed')
        return super().process(*args, **kwargs)


def test_values_are_those_of_the_core():
    result, failure = FrameRefiner().refine(PAIR, None, PARAMS, 1)
    expected = StereoRefiner(PARAMS).process(PAIR.left, PAIR.right)
    np.testing.assert_array_equal(result.disparity.values, expected.disparity.values)
    assert failure is None


def test_repeated_failure_gives_the_preliminary_disparity_until_refining_works_again(
        monkeypatch):
    refiner = FrameRefiner(Broken)
    for _ in range(FAILURES_BEFORE_FALLBACK - 1):
        with pytest.raises(RuntimeError, match='kernel failed'):
            refiner.refine(PAIR, None, PARAMS, 2)
    result, failure = refiner.refine(PAIR, None, PARAMS, 2)
    expected = StereoRefiner(PARAMS).preliminary_only(PAIR.left, PAIR.right)
    np.testing.assert_array_equal(result.disparity.values, expected.disparity.values)
    assert str(failure) == 'kernel failed'
    monkeypatch.setattr(Broken, 'is_broken', False)
    assert refiner.refine(PAIR, None, PARAMS, 2)[1] is None
    monkeypatch.setattr(Broken, 'is_broken', True)
    with pytest.raises(RuntimeError):  # one failure is forgiven again
        refiner.refine(PAIR, None, PARAMS, 2)


def test_one_refiner_serves_frames_until_parameters_change():
    made = []

    def make(params):
        made.append(params.matching.num_disparities)
        return StereoRefiner(params)

    refiner = FrameRefiner(make)
    wider = PARAMS.updated({'matching.num_disparities': 32})
    for params in (PARAMS, PARAMS, wider):
        result, _ = refiner.refine(PAIR, None, params, 2)
        assert result.disparity.num_disparities == params.matching.num_disparities
    assert made == [16, 32]


def test_mixed_color_and_grey_are_matched_in_grey():
    messages = stereo_messages(*textured_pair(), 1)
    messages['right/image_rect'] = stereo_messages(
        *textured_pair(color=False), 1)['right/image_rect']
    pair = decode_frame(check_frame(MessageSet(1, messages), Calibration())).pair
    assert pair.left.shape == pair.right.shape == (96, 160)


def test_sizes_that_differ_are_refused():
    messages = stereo_messages(*textured_pair(), 1)
    messages['right/image_rect'] = stereo_messages(
        *textured_pair(width=100), 1)['right/image_rect']
    with pytest.raises(BadMessage) as error:
        check_frame(MessageSet(1, messages), Calibration())
    assert error.value.reason == 'size_differs'

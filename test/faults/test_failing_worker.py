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

"""A kernel that fails, parameters under fire and the files touched, in a node in this process."""

from collections import Counter
import threading

from harness import floats, stamp_of, stereo_messages
from live_harness import Harness, PAIR, PARAMS
import numpy as np
import pytest
from rclpy.parameter import Parameter
from sensor_msgs.msg import Image

from stereo_refine_ros import pipeline
from stereo_refine_ros.node import views
from stereo_refine_ros.node.frame_refiner import FAILURES_BEFORE_FALLBACK
from stereo_refine_ros.params import load_preset
from stereo_refine_ros.pipeline import StereoRefiner

pytestmark = pytest.mark.ros


@pytest.fixture
def harness(monkeypatch):
    made = Harness()
    yield made
    monkeypatch.undo()
    made.close()


def failing(*args, **kwargs):
    raise ZeroDivisionError('a kernel failed')


def test_a_kernel_that_fails_is_reported_and_the_preliminary_goes_out(harness, monkeypatch):
    client = harness.client
    good, = client.exchange(harness.pair(), timeout_s=60.0)
    with monkeypatch.context() as broken:
        broken.setattr(StereoRefiner, 'process', failing)
        client.received['disparity'].clear()
        client.received['/diagnostics'].clear()
        for number in range(1, FAILURES_BEFORE_FALLBACK):
            client.send(harness.pair())
            harness.until_failed(number)
        assert client.received['disparity'] == []
        harness.until_diagnosed('refinement failed', b'\x02')
        message, metrics = client.exchange(harness.pair(), ('disparity', 'metrics'))
        harness.until_diagnosed('publishing the preliminary disparity instead', b'\x02')
    figures = {item.key: item.value for item in metrics.status[0].values}
    assert figures['degraded'] == '1' and metrics.status[0].level == b'\x02'
    expected = StereoRefiner(load_preset('live', PARAMS)).preliminary_only(*PAIR).disparity.values
    np.testing.assert_array_equal(floats(message.image), np.nan_to_num(expected, nan=-1.0))
    # Once refining works again, the next frame is refined, and the ERROR ends.
    back, metrics = client.exchange(harness.pair(), ('disparity', 'metrics'))
    assert back.image.data == good.image.data
    assert metrics.status[0].level == b'\x00'
    client.received['/diagnostics'].clear()
    harness.until_diagnosed('refining at', b'\x00')
    health = client.health()
    assert health['processing_failures'] == 3 and health['frames_degraded'] == 1
    assert health['refused.processing'] == 2


def test_a_matcher_that_fails_too_costs_frames_and_nothing_else(harness, monkeypatch):
    client = harness.client
    client.exchange(harness.pair(), timeout_s=60.0)
    with monkeypatch.context() as broken:
        broken.setattr(StereoRefiner, 'process', failing)
        broken.setattr(pipeline, 'find_match', failing)
        for number in range(1, 6):
            client.send(harness.pair())
            harness.until_failed(number)
        harness.until_diagnosed('refinement failed', b'\x02')
    client.exchange(harness.pair())
    client.until(lambda: client.health()['pairs_published'] == 2, 5.0, 'the counters')
    health = client.health()
    assert health['refused.processing'] == 5
    assert health['pairs_received'] == health['pairs_published'] + 5


def test_a_failing_view_costs_neither_the_disparity_nor_the_metrics(harness, monkeypatch):
    client = harness.client
    client.subscribe('disparity/color', Image)
    client.subscribe('depth', Image)
    client.until(lambda: all(map(harness.node._outputs.wants, ('disparity/color', 'depth'))),
                 10.0, 'subscribers of the views')
    monkeypatch.setitem(views.VIEWS, 'disparity/color', failing)
    client.exchange(harness.pair(), ('disparity', 'depth', 'metrics'), timeout_s=60.0)
    assert client.received['disparity/color'] == []
    harness.until_diagnosed('refinement failed', b'\x02')


def test_parameters_are_swapped_whole_between_frames(harness, monkeypatch):
    """Two sets that must never mix, swapped as fast as can be while frames flow."""
    sets = [{'segmentation.min_size': 11, 'filter.radius': 1, 'planes.seed': 111},
            {'segmentation.min_size': 22, 'filter.radius': 2, 'planes.seed': 222}]
    seen = Counter()
    process = StereoRefiner.process

    def spy(refiner, *args, **kwargs):
        def look():
            params = refiner.params
            return (params.segmentation.min_size, params.filter.radius, params.planes.seed)
        before = look()
        result = process(refiner, *args, **kwargs)
        seen[before] += 1
        assert look() == before
        return result

    client = harness.client
    assert client.set_atomically(**{
        name.replace('.', '__'): value for name, value in sets[0].items()}).successful
    client.exchange(harness.pair(), timeout_s=60.0)
    monkeypatch.setattr(StereoRefiner, 'process', spy)
    stop, swaps = threading.Event(), Counter()

    def swap():
        while not stop.wait(0.005):  # or the frames starve
            values = sets[swaps['done'] % 2]
            result = harness.node.set_parameters_atomically(
                [Parameter(name, value=value) for name, value in values.items()])
            swaps['done' if result.successful else 'refused'] += 1
    thread = threading.Thread(target=swap)
    thread.start()
    try:
        for _ in range(60):
            client.exchange(harness.pair(), timeout_s=30.0)
    finally:
        stop.set()
        thread.join()
    assert set(seen) <= {(11, 1, 111), (22, 2, 222)} and len(seen) == 2, seen
    assert sum(seen.values()) == 60
    assert swaps['done'] > 60 and swaps['refused'] == 0
    assert client.health()['processing_failures'] == 0


def test_thread_counts_give_the_same_bits(harness):
    client, answers = harness.client, []
    stamps = [harness.stamp + i * 33_000_000 for i in range(4)]
    rng = np.random.default_rng(5)
    pairs = []
    for _ in stamps:
        wide = rng.integers(0, 256, (96, 166, 3), np.uint8)
        pairs.append((wide[:, :160].copy(), wide[:, 6:].copy()))
    for threads in (1, 2, 1, 3):
        assert client.set_atomically(
            processing__threads=threads, temporal__enabled=False).successful
        answers.append([
            bytes(client.exchange(stereo_messages(*pair, stamp), timeout_s=60.0)[0].image.data)
            for pair, stamp in zip(pairs, stamps, strict=True)])
        assert stamp_of(stamps[-1]) == client.received['disparity'][-1].header.stamp
    assert answers[1:] == answers[:1] * 3
    assert len(set(answers[0])) == len(stamps)

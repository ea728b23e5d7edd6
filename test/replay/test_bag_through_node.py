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

"""A recorded bag, replayed through the real node, gives what the core gives by itself."""

from contextlib import contextmanager
import subprocess
import sys

from bag_writer import NS, pair_messages, write_messages
from listener import pixels, replaying, stamp_ns
import numpy as np
import pytest
from stereo_msgs.msg import DisparityImage

from stereo_refine_ros.datasets import render_scene
from stereo_refine_ros.datasets.rosbag import iterate_pairs
from stereo_refine_ros.node.views import sure_part
from stereo_refine_ros.params import load_preset
from stereo_refine_ros.pipeline import StereoRefiner

pytestmark = pytest.mark.ros
PAIRS = 4
DOFFS = 2.0
CAMERA = ('left/image_rect', 'right/image_rect', 'left/camera_info', 'right/camera_info')


@contextmanager
def _node(log_path):
    reliable = [part for topic in CAMERA for part in (
        '-p', f'qos_overrides./{topic}.subscription.reliability:=reliable')]
    with log_path.open('wb') as log:
        process = subprocess.Popen(
            [sys.executable, '-m', 'stereo_refine_ros.refine_node', '--ros-args', '-p',
             'matching.num_disparities:=24', '-p', 'use_sim_time:=true',
             '-p', 'output.min_confidence:=0.0', '-p', 'temporal.enabled:=false', *reliable],
            stdout=log, stderr=log)
        try:
            yield
        finally:
            process.terminate()
            process.wait(20)


def test_bag_through_the_node_equals_the_core(listen, tmp_path):
    scenes = [render_scene(seed, 120, 160, 24, 2, doffs_px=DOFFS) for seed in range(PAIRS)]
    views = [(scene.pair.left, scene.pair.right) for scene in scenes]
    # Half a second apart: every frame is done before the next one comes, none is dropped.
    messages = pair_messages(views, scenes[0].geometry, period_ns=NS // 2)
    write_messages(tmp_path / 'bag', 'mcap', messages)
    outputs = ('disparity', 'disparity/preliminary')
    listener = listen({name: DisparityImage for name in outputs})
    with _node(tmp_path / 'node.log'):
        listener.wait(lambda: 'ready after' in (tmp_path / 'node.log').read_text(), 90)
        # Twice over: the jump back in time must not stop the pairing.
        with replaying('--bag', tmp_path / 'bag', '--loop', 2, '--wait', 20, '--clock'):
            listener.wait(lambda: all(len(got) >= 2 * PAIRS for got in
                                      listener.received.values()))
    refiner = StereoRefiner(load_preset(
        'live', {'matching.num_disparities': 24, 'temporal.enabled': False}))
    recorded = list(iterate_pairs(tmp_path / 'bag'))
    results = [refiner.process(item.pair.left, item.pair.right) for item in recorded]
    maps = {'disparity': [sure_part(result, 0.0) for result in results],
            'disparity/preliminary': [result.preliminary for result in results]}
    for name in outputs:
        received = listener.received[name]
        assert [stamp_ns(message) for message in received] == [
            item.stamp_ns for item in recorded] * 2
        for message, disparity in zip(received, maps[name] * 2, strict=True):
            values = disparity.values
            expected = np.where(np.isfinite(values), values + np.float32(DOFFS), DOFFS - 1)
            np.testing.assert_array_equal(pixels(message.image, np.float32), expected)

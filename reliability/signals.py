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

"""
Signals at every stage of the node's life, many times over real DDS.

The node has to end within two seconds with code 0, without a traceback, a child process or a
file in shared memory left behind. Ends with 1 when it once did not.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
import signal
import sys
import threading
import time

from malformed import pick
from node_run import left_behind, NodeRun
import numpy as np
import psutil
import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile
from stereo_msgs.msg import DisparityImage
from stereo_refine_ros.dds_domain import use_own_domain
from stereo_refine_ros.messages.scene import (
    camera_info_messages, image_message, nominal_geometry, scene_header)

KINDS = {'SIGINT': (signal.SIGINT,), 'SIGINT twice': (signal.SIGINT, signal.SIGINT),
         'SIGTERM': (signal.SIGTERM,)}
STAGES = ('starting', 'idle', 'busy')
LIMIT_S = 2.0


@dataclass(frozen=True)
class Ending:
    """How a node process ended."""

    seconds: float
    code: int | None
    faults: tuple[str, ...]


class Traffic(Node):
    """A camera and a listener, which keep the node busy."""

    def __init__(self, width: int = 320, height: int = 240, rate: float = 30.0) -> None:
        """Make the messages; `run` publishes them."""
        super().__init__('traffic')
        self._period_s = 1.0 / rate
        self._stop = threading.Event()
        self.create_subscription(DisparityImage, 'disparity', lambda _: None, QoSProfile(depth=1))
        wide = np.random.default_rng(0).integers(0, 256, (height, width + 8, 3), np.uint8)
        header = scene_header(self.get_clock().now().to_msg())
        infos = camera_info_messages(nominal_geometry(height, width), height, width, header)
        messages = {
            'left/camera_info': infos[0], 'right/camera_info': infos[1],
            'left/image_rect': image_message(wide[:, :width], 'bgr8', header),
            'right/image_rect': image_message(wide[:, 8:], 'bgr8', header)}
        self._pairs = [(self.create_publisher(type(message), topic, 1), message)
                       for topic, message in messages.items()]

    def run(self) -> None:
        """Publish until `stop`."""
        while not self._stop.wait(self._period_s):
            stamp = self.get_clock().now().to_msg()
            for publisher, message in self._pairs:
                message.header.stamp = stamp
                publisher.publish(message)

    def stop(self) -> None:
        """End `run`."""
        self._stop.set()


@contextmanager
def traffic() -> Iterator[None]:
    """Keep a camera going for a block."""
    rclpy.init()
    node = Traffic()
    thread = threading.Thread(target=node.run)
    thread.start()
    try:
        yield
    finally:
        node.stop()
        thread.join()
        node.destroy_node()
        rclpy.try_shutdown()


def end_once(stage: str, kind: str, rng: np.random.Generator) -> Ending:
    """Start a node, send the signals at a random moment of a stage, and look at what is left."""
    run = NodeRun('-p', 'matching.num_disparities:=32')
    run.wait_for_own_code()
    if stage == 'starting':
        time.sleep(rng.uniform(0.0, 1.5))
    else:
        run.wait_for('ready after')
        time.sleep(rng.uniform(0.3, 0.6))
    files = run.shared_memory()
    children = run.info.children(recursive=True)
    seconds = run.end(*KINDS[kind], gap_s=pick(rng, (0.0, 0.001, 0.005)))
    return Ending(seconds, run.process.returncode, tuple(_faults(run, seconds, files, children)))


def _faults(run: NodeRun, seconds: float, files: set[tuple[str, int]],
            children: list[psutil.Process]) -> Iterator[str]:
    if seconds > LIMIT_S:
        yield f'took {seconds:.2f} s'
    if run.process.returncode != 0:
        yield f'exit code {run.process.returncode}'
    if 'Traceback' in run.log:
        yield f'traceback:\n{run.log}'
    yield from (f'orphan {child}' for child in children if child.is_running())
    yield from (f'left {path}' for path in left_behind(files))


def measure(times: int, stages: tuple[str, ...], seed: int) -> int:
    """Print a row for every stage and kind; return the number of faults."""
    rng, faults = np.random.default_rng(seed), 0
    print('| stage | signals | times | median s | slowest s | faults |\n|---|---|---|---|---|---|')
    for stage in stages:
        for kind in KINDS:
            if stage == 'busy':
                with traffic():
                    endings = [end_once(stage, kind, rng) for _ in range(times)]
            else:
                endings = [end_once(stage, kind, rng) for _ in range(times)]
            seconds = [ending.seconds for ending in endings]
            wrong = [fault for ending in endings for fault in ending.faults]
            faults += len(wrong)
            print(f'| {stage} | {kind} | {times} | {np.median(seconds):.2f} | '
                  f'{max(seconds):.2f} | {len(wrong)} |', flush=True)
            print(''.join(f'  {fault}\n' for fault in wrong), end='', flush=True)
    return faults


def main() -> int:
    """Read the command line and measure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--times', type=int, default=100, help='of every stage and kind')
    parser.add_argument('--stages', default=','.join(STAGES))
    parser.add_argument('--seed', type=int, default=0)
    options = parser.parse_args()
    use_own_domain()
    return int(measure(options.times, tuple(options.stages.split(',')), options.seed) > 0)


if __name__ == '__main__':
    sys.exit(main())

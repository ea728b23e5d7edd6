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
Camera process and node process over DDS for a while: rates, latency, drops, CPU, memory.

Latency is from the images' stamp, once to the node's publishing (its own metric) and once to
the receipt of the disparity here. SGBM 3-way is timed before and after, as a measure of the
machine's speed at that time. Ends with 1 when the node did not end cleanly.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
import json
import os
from pathlib import Path
import signal
import subprocess
import sys
import time
from typing import Any

from cases import load_case
import cv2
from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
from opencv_methods import match
import psutil
import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import CameraInfo
from stereo_msgs.msg import DisparityImage
from stereo_refine_ros.dds_domain import use_own_domain
from timing import quartiles, time_rounds

HERE = Path(__file__).resolve().parent
NAMESPACE = '/benchmark'


@dataclass
class Sample:
    """What was seen between two moments."""

    stamps_in: list[float] = field(default_factory=list)
    stamps_out: list[float] = field(default_factory=list)
    received_ms: list[float] = field(default_factory=list)
    published_ms: list[float] = field(default_factory=list)
    memory_mb: list[float] = field(default_factory=list)


class Listener(Node):
    """Count what the camera sends and what the node answers."""

    def __init__(self) -> None:
        """Subscribe; the disparity as a robot's next node would."""
        super().__init__('benchmark_listener', namespace=NAMESPACE)
        self.sample = Sample()
        self.create_subscription(
            CameraInfo, 'left/camera_info', self._on_input, QoSProfile(depth=1000))
        self.create_subscription(
            DisparityImage, 'disparity', self._on_disparity, QoSProfile(depth=1))
        self.create_subscription(
            DiagnosticArray, 'metrics', self._on_metrics, QoSProfile(depth=100))

    def _on_input(self, message: CameraInfo) -> None:
        self.sample.stamps_in.append(seconds(message.header.stamp))

    def _on_disparity(self, message: DisparityImage) -> None:
        stamp = seconds(message.header.stamp)
        self.sample.stamps_out.append(stamp)
        self.sample.received_ms.append((time.time() - stamp) * 1e3)

    def _on_metrics(self, message: DiagnosticArray) -> None:
        values = {pair.key: pair.value for pair in message.status[0].values}
        self.sample.published_ms.append(float(values['frame_latency_ms']))

    def listen(self, duration_s: float, process: psutil.Process | None = None) -> Sample:
        """Listen for a time and return what came, with the memory of `process` each second."""
        self.sample = Sample()
        end, next_look = time.monotonic() + duration_s, 0.0
        while (now := time.monotonic()) < end:
            rclpy.spin_once(self, timeout_sec=min(0.1, end - now))
            if process is not None and now >= next_look:
                self.sample.memory_mb.append(process.memory_info().rss / 1e6)
                next_look = now + 1.0
        return self.sample

    def wait_until_ready(self, node: psutil.Process, timeout_s: float) -> None:
        """Wait for the first disparity; the node may have to compile its kernels."""
        end = time.monotonic() + timeout_s
        while not self.sample.stamps_out:
            if time.monotonic() > end or not node.is_running():
                raise SystemExit(f'no disparity within {timeout_s:.0f} s')
            rclpy.spin_once(self, timeout_sec=0.1)


def seconds(stamp: Any) -> float:
    """Return a stamp as seconds."""
    return stamp.sec + stamp.nanosec * 1e-9


def sgbm_ms(options: argparse.Namespace) -> float:
    """Return the median time of OpenCV's SGBM 3-way at this size."""
    width, height, disparities = map(int, options.size.split('x'))
    case = load_case(options.scene, width, height, disparities)
    mode = cv2.STEREO_SGBM_MODE_SGBM_3WAY
    times, _ = time_rounds(
        {'sgbm': lambda: match((case.left, case.right), disparities, mode)}, 15, 10.0)
    return quartiles(times['sgbm'])[1]


@contextmanager
def running(command: list[str], environment: dict[str, str]) -> Iterator[subprocess.Popen[bytes]]:
    """Run a process; interrupt it at the end, and kill it when that does not help."""
    process = subprocess.Popen(command, env=environment)
    try:
        yield process
        process.send_signal(signal.SIGINT)
        process.wait(timeout=10)
    finally:
        process.kill()


def commands(options: argparse.Namespace) -> tuple[list[str], list[str]]:
    """Return the command lines of node and camera."""
    ros = ['--ros-args', '-r', f'__ns:={NAMESPACE}']
    node = [sys.executable, '-m', 'stereo_refine_ros.refine_node', *ros,
            '-p', f'preset:={options.preset}',
            '-p', f'matching.num_disparities:={options.size.split("x")[2]}']
    camera = [sys.executable, str(HERE / 'camera.py'), '--rate', str(options.rate),
              '--scene', options.scene, '--size', options.size,
              '--encoding', options.encoding, *ros]
    return node, camera


def measure(options: argparse.Namespace) -> dict[str, Any]:
    """Run both processes and return the figures."""
    environment = dict(os.environ)
    node_command, camera_command = commands(options)
    rclpy.init()
    listener = Listener()
    with running(node_command, environment) as node, running(camera_command, environment):
        process = psutil.Process(node.pid)
        listener.wait_until_ready(process, options.start_timeout)
        listener.listen(options.settle)
        cpu_before, start = sum(process.cpu_times()[:2]), time.monotonic()
        sample = listener.listen(options.seconds, process)
        elapsed = time.monotonic() - start
        cpu = (sum(process.cpu_times()[:2]) - cpu_before) / elapsed
    rclpy.try_shutdown()
    return {**figures(sample), 'cpu_cores': cpu, 'node_exit_code': node.returncode}


def figures(sample: Sample) -> dict[str, Any]:
    """Turn what was seen into figures; the last half second may still be under way."""
    ended = max(sample.stamps_in) - 0.5
    sent = [stamp for stamp in sample.stamps_in if stamp <= ended]
    answered = set(sample.stamps_out)
    thirds = np.array_split(sample.memory_mb, 3)
    halves = np.array_split(sample.received_ms, 2)
    return {
        'rate_in_hz': rate(sample.stamps_in), 'rate_out_hz': rate(sample.stamps_out),
        'dropped_percent': 100.0 * sum(stamp not in answered for stamp in sent) / len(sent),
        **percentiles('stamp_to_publish_ms', sample.published_ms),
        **percentiles('stamp_to_receive_ms', sample.received_ms),
        'latency_growth_ms': float(np.median(halves[1]) - np.median(halves[0])),
        'memory_peak_mb': max(sample.memory_mb),
        'memory_growth_mb': float(np.mean(thirds[2]) - np.mean(thirds[1]))}


def rate(stamps: list[float]) -> float:
    """Return how many stamps there are in a second."""
    return (len(stamps) - 1) / (max(stamps) - min(stamps)) if len(stamps) > 1 else 0.0


def percentiles(name: str, values: list[float]) -> dict[str, float]:
    """Return the 50th, 95th and 99th percentile under names of their own."""
    return {f'{name}_p{rank}': float(np.percentile(values, rank)) for rank in (50, 95, 99)}


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seconds', type=float, default=60.0, help='how long to measure')
    parser.add_argument('--rate', type=float, default=30.0, help='pairs a second')
    parser.add_argument('--preset', default='live')
    parser.add_argument('--scene', default='Adirondack')
    parser.add_argument('--size', default='640x480x64', help='width x height x disparities')
    parser.add_argument('--encoding', default='bgr8', choices=('bgr8', 'mono8'))
    parser.add_argument('--settle', type=float, default=3.0, help='seconds before measuring')
    parser.add_argument('--start-timeout', type=float, default=300.0, help='seconds')
    parser.add_argument('--json', type=Path, help='write the figures here as well')
    return parser.parse_args()


def main() -> None:
    """Measure and print."""
    options = parse()
    use_own_domain()
    profile = HERE.parent / 'config' / 'fastdds_shm.xml'
    os.environ.setdefault('FASTRTPS_DEFAULT_PROFILES_FILE', str(profile))
    before = sgbm_ms(options)
    result = measure(options)
    result = {'sgbm_3way_before_ms': before, **result, 'sgbm_3way_after_ms': sgbm_ms(options)}
    print(f'{options.preset}, {options.size} {options.encoding}, {options.rate:g} Hz in, '
          f'{options.seconds:g} s\n\n| figure | value |\n| --- | --- |')
    for name, value in result.items():
        print(f'| {name} | {value:.2f} |')
    if options.json:
        options.json.write_text(json.dumps(result, indent=2) + '\n', encoding='utf-8')
    sys.exit(1 if result['node_exit_code'] else 0)


if __name__ == '__main__':
    main()

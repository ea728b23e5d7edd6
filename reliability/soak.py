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
Camera and node as processes over DDS for a long time, with faults injected from a seed.

The camera sends malformed and incomplete sets, pauses, changes its size, jumps back in time and
kills itself; parameters change and listeners come and go. At the end every set that the camera
sent whole must have been published, superseded by a newer one or refused, and the node's memory,
threads and files must be level. Ends with 1 when that is not so.
"""

from __future__ import annotations

import argparse
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
import signal
import subprocess
import sys
import tempfile
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from malformed import LEFT, LEFT_INFO, pick, RIGHT, RIGHT_INFO
from node_run import NodeRun
import numpy as np
import rclpy
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import QoSProfile
from sensor_msgs.msg import Image, PointCloud2
from stereo_msgs.msg import DisparityImage
from stereo_refine_ros.dds_domain import use_own_domain

CAMERA = Path(__file__).with_name('soak_camera.py')
CHANGES: dict[str, tuple[Any, ...]] = {
    'matching.num_disparities': (16, 32, 33), 'planes.projection': ('guarded', 'full', 'off'),
    'filter.method': ('weighted_median', 'none', 'guided'), 'segmentation.k': (100.0, 300.0),
    'processing.threads': (1, 2), 'filter.radius': (-1, 3), 'segmentation.min_size': (20, 50)}
VIEWS = {'disparity/color': Image, 'points': PointCloud2, 'depth': Image, 'segments': Image}
WARM_UP = 0.25  # share of the run before memory, threads and files have to be level
LEVEL_FROM_S = 120.0  # a shorter run says nothing of them
PARTS = 5
LIMITS = {'memory MB': 15.0, 'threads': 2.0, 'files': 4.0}


@dataclass
class Samples:
    """What the node process used, by the second."""

    seconds: list[float] = field(default_factory=list)
    values: dict[str, list[float]] = field(default_factory=dict)

    def take(self, run: NodeRun, began: float) -> None:
        """Look at the process once."""
        self.seconds.append(time.monotonic() - began)
        for name, value in (('memory MB', run.info.memory_info().rss / 1e6),
                            ('threads', run.info.num_threads()),
                            ('files', run.info.num_fds())):
            self.values.setdefault(name, []).append(value)

    def rows(self) -> list[tuple[str, list[float], float]]:
        """Return for each its name, medians over time and slope per hour, after the warm-up."""
        first = int(len(self.seconds) * WARM_UP)
        seconds, rows = np.array(self.seconds[first:]), []
        for name, values in self.values.items():
            level = np.array(values[first:])
            slope = float(np.polyfit(seconds, level, 1)[0]) * 3600.0
            parts = [float(np.median(part)) for part in np.array_split(level, PARTS)]
            rows.append((name, parts, slope))
        return rows


class Watcher(Node):
    """Listen to the disparity all the time, to views now and then, and change parameters."""

    def __init__(self, seed: int) -> None:
        """Listen to disparities and diagnostics."""
        super().__init__('soak_watcher')
        self._rng = np.random.default_rng(seed)
        self._view: Any = None
        self._client = AsyncParameterClient(self, 'refine_node')
        self.disparities = 0
        self.accounts: dict[str, int] = {}
        self.events: Counter[str] = Counter()
        self.create_subscription(
            DisparityImage, 'disparity', self._on_disparity, QoSProfile(depth=10))
        self.create_subscription(
            DiagnosticArray, '/diagnostics', self._on_diagnostics, QoSProfile(depth=10))

    def disturb(self) -> None:
        """Change a parameter or a listener."""
        if self._rng.random() < 0.5:
            name = pick(self._rng, list(CHANGES))
            self._client.set_parameters_atomically(
                [Parameter(name, value=pick(self._rng, CHANGES[name]))])
            self.events['parameter changes'] += 1
        elif self._view is None:
            topic = pick(self._rng, list(VIEWS))
            self._view = self.create_subscription(
                VIEWS[topic], topic, lambda _: None, QoSProfile(depth=1))
            self.events['listeners that came and went'] += 1
        else:
            self.destroy_subscription(self._view)
            self._view = None

    def _on_disparity(self, message: DisparityImage) -> None:
        self.disparities += 1
        values = np.frombuffer(message.image.data, np.float32)
        if not np.isfinite(values).all() or values.min() < message.min_disparity - 1.001:
            self.events['absurd disparities'] += 1

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        self.accounts = {item.key: int(item.value) for item in message.status[0].values
                         if '.' not in item.value and item.value != 'nan'}


class Soak:
    """One run."""

    def __init__(self, options: argparse.Namespace, log: Path) -> None:
        """Start node and camera."""
        self.options, self.log = options, log
        overrides = [part for topic in (LEFT, RIGHT, LEFT_INFO, RIGHT_INFO) for part in (
            '-p', f'qos_overrides./{topic}.subscription.reliability:=reliable',
            '-p', f'qos_overrides./{topic}.subscription.depth:=100')]
        self.run = NodeRun('-p', 'matching.num_disparities:=32', '-p', 'sync.queue_size:=100',
                           *overrides)
        self.run.wait_for('ready after', 120.0)
        self.watcher = Watcher(options.seed)
        self.samples = Samples()
        self.cameras = 0
        self.camera = self._start_camera(options.fault_rate)

    def _start_camera(self, fault_rate: float) -> subprocess.Popen[bytes]:
        self.cameras += 1
        return subprocess.Popen(
            [sys.executable, str(CAMERA), '--log', str(self.log), '--rate',
             str(self.options.rate), '--seed', str(self.options.seed + self.cameras),
             '--fault-rate', str(fault_rate)])

    def go(self) -> None:
        """Disturb for the time chosen, then let everything settle."""
        began = next_look = time.monotonic()
        while (now := time.monotonic()) - began < self.options.seconds:
            rclpy.spin_once(self.watcher, timeout_sec=0.05)
            if now >= next_look:
                next_look += 1.0
                self.samples.take(self.run, began)
                self.watcher.disturb()
                if self.camera.poll() is not None:
                    self.camera = self._start_camera(self.options.fault_rate)
        if self._end_camera() == -signal.SIGKILL:
            # Killed within its last set: only the next whole one tells that nothing is to come.
            self.camera = self._start_camera(0.0)
            self._spin(8.0)
            self._end_camera()

    def _end_camera(self) -> int:
        self.camera.terminate()
        self._spin(5.0)
        return self.camera.wait(10.0)

    def _spin(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            rclpy.spin_once(self.watcher, timeout_sec=0.05)

    def close(self) -> float:
        """End the node; return the seconds it took."""
        self.watcher.destroy_node()
        return self.run.end()


def report(soak: Soak) -> list[str]:
    """Print the accounts; return what is wrong."""
    sent = Counter(soak.log.read_text(encoding='utf-8').splitlines())
    accounts, wrong = soak.watcher.accounts, []
    malformed = sum(count for kind, count in sent.items() if kind.startswith('malformed'))
    whole = sent['good'] + malformed
    print('| sets | count |\n|---|---|')
    rows = {'sent whole': whole, 'of these malformed': malformed,
            'received whole by the node': accounts['pairs_received'],
            'of which a part was lost on the way': whole - accounts['pairs_received'],
            'published': accounts['pairs_published'],
            'superseded by a newer one': accounts['pairs_superseded'],
            'refused with a reason': accounts['pairs_refused'],
            'in flight at the end': accounts['pairs_in_flight'],
            'sent without the right image': sent['incomplete'],
            'unmatched': accounts['pairs_unmatched'],
            'exceptions in the processing': accounts['processing_failures'],
            **{kind: sent[kind] for kind in (
                'killed', 'pause', 'clock jumps back', 'size changes')},
            **soak.watcher.events}
    print('\n'.join(f'| {name} | {count} |' for name, count in rows.items()))
    print('\nrefused: ' + ', '.join(f'{key.partition(".")[2]} {count}' for key, count in
                                    accounts.items() if key.startswith('refused.')))
    # A set of which the middleware lost a part is unmatched, as one that was sent incomplete is.
    checks = {
        'what was sent and what is accounted for differ': whole + sent['incomplete'] == (
            accounts['pairs_received'] + accounts['pairs_unmatched']),
        'sets in flight': accounts['pairs_in_flight'] == 0,
        'received, published, superseded and refused differ': accounts['pairs_received'] == (
            accounts['pairs_published'] + accounts['pairs_superseded']
            + accounts['pairs_refused']),
        'more refused than malformed': accounts['pairs_refused'] <= malformed,
        'exceptions': accounts['processing_failures'] == 0,
        'absurd disparities': soak.watcher.events['absurd disparities'] == 0}
    wrong += [text for text, is_right in checks.items() if not is_right]
    print('\n| node process | medians over time | slope per hour |\n|---|---|---|')
    for name, parts, slope in soak.samples.rows():
        print(f'| {name} | {", ".join(f"{part:.1f}" for part in parts)} | {slope:+.1f} |')
        if parts[-1] - parts[0] > LIMITS[name] and soak.options.seconds >= LEVEL_FROM_S:
            wrong.append(f'{name} grew by {parts[-1] - parts[0]:.1f}')
    return wrong


def main() -> int:
    """Run and report."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seconds', type=float, default=1800.0)
    parser.add_argument('--rate', type=float, default=15.0, help='sets a second')
    parser.add_argument('--fault-rate', type=float, default=0.1, help='faults per set')
    parser.add_argument('--seed', type=int, default=0)
    options = parser.parse_args()
    use_own_domain()
    rclpy.init()
    with tempfile.TemporaryDirectory() as folder:
        soak = Soak(options, Path(folder) / 'camera.log')
        try:
            soak.go()
            wrong = report(soak)
        finally:
            soak.camera.kill()
            seconds = soak.close()
    rclpy.try_shutdown()
    wrong += ['the node did not end cleanly'] if soak.run.process.returncode else []
    wrong += ['traceback in the log'] if 'Traceback' in soak.run.log else []
    print(f'\n{options.seconds:g} s, seed {options.seed}; the node ended in {seconds:.2f} s; '
          + ('; '.join(wrong) or 'all is accounted for'))
    return int(bool(wrong))


if __name__ == '__main__':
    sys.exit(main())

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
Camera and node on two hosts: network namespaces joined by a veth, clean and lossy.

Each host has a /dev/shm of its own, so that nothing but the cable joins the two. The camera
publishes 640x480 colour pairs; a listener at the far end counts the disparities that arrive.
Needs root and iproute2.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
import json
import os
from pathlib import Path
import shutil
import signal
import subprocess
import sys
import tempfile
import time

import numpy as np

HERE = Path(__file__).resolve().parent
CONFIG = HERE.parent / 'config'
CAMERA = HERE.parent / 'benchmarks' / 'camera.py'
CAMERA_HOST, FAR_HOST, CABLE = (f'{name}{os.getpid()}' for name in ('camera', 'far', 'cable'))
INPUTS = ('left/image_rect', 'right/image_rect', 'left/camera_info', 'right/camera_info')
TOOLS = ('ip', 'mount')
LINKS = {'clean': (0.0, 0.0), '20 ms, 1 %': (20.0, 1.0)}
RELIABLE = tuple(part for topic in INPUTS for policy, value in (
    ('reliability', 'reliable'), ('depth', '1')) for part in (
        '-p', f'qos_overrides./{topic}.subscription.{policy}:={value}'))


@dataclass(frozen=True)
class Transport:
    """Where the node runs, its arguments, and the environment of all processes."""

    name: str
    node_host: str
    node_args: tuple[str, ...]
    environment: dict[str, str]


def profile(name: str) -> dict[str, str]:
    """Return the environment that makes Fast DDS read a profile of `config/`."""
    return {'FASTRTPS_DEFAULT_PROFILES_FILE': str(CONFIG / f'fastdds_{name}.xml')}


TRANSPORTS = (
    Transport('UDP, best effort', FAR_HOST, (), {}),
    Transport('UDP, reliable', FAR_HOST, RELIABLE, {}),
    Transport('TCP (LARGE_DATA), reliable', FAR_HOST, RELIABLE,
              {'FASTDDS_BUILTIN_TRANSPORTS': 'LARGE_DATA'}),
    Transport('fastdds_two_hosts.xml, reliable', FAR_HOST, RELIABLE, profile('two_hosts')),
    Transport('node beside the camera, fastdds_shm.xml', CAMERA_HOST, (), profile('shm')),
    Transport('node beside the camera, fastdds_two_hosts.xml', CAMERA_HOST, (),
              profile('two_hosts')),
)


def run(*command: str) -> None:
    """Run a command to its end, loudly."""
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


@contextmanager
def two_hosts(folder: Path, delay_ms: float, loss_percent: float) -> Iterator[None]:
    """Make two network namespaces with a cable between them; remove them at the end."""
    lossy = delay_ms > 0 or loss_percent > 0
    hosts = (CAMERA_HOST, FAR_HOST, *((CABLE,) if lossy else ()))
    try:
        for host in hosts:
            run('ip', 'netns', 'add', host)
        ends = ((CABLE, 'end0'), (CABLE, 'end1')) if lossy else ((FAR_HOST, 'eth0'),)
        for host, (peer_host, peer) in zip((CAMERA_HOST, FAR_HOST), ends, strict=False):
            run('ip', 'link', 'add', 'eth0', 'netns', host, 'type', 'veth',
                'peer', 'name', peer, 'netns', peer_host)
        for number, host in enumerate((CAMERA_HOST, FAR_HOST), 1):
            plug_in(host, f'10.77.0.{number}/24')
            (folder / host).mkdir()
            run('mount', '-t', 'tmpfs', host, str(folder / host))
        if not lossy:
            yield
            return
        for end in ('end0', 'end1'):
            run('ip', '-n', CABLE, 'link', 'set', end, 'up')
        with process(CABLE, {}, str(HERE / 'cable.py'), 'end0', 'end1', '--delay-ms',
                     str(delay_ms), '--loss-percent', str(loss_percent)):
            yield
    finally:
        for host in hosts:
            subprocess.run(['ip', 'netns', 'delete', host], check=False)
            subprocess.run(['umount', str(folder / host)], check=False, capture_output=True)


def plug_in(host: str, address: str) -> None:
    """Give a host its address; its packets leave complete, as from a network card."""
    ip = ('ip', '-n', host)
    run('ip', 'netns', 'exec', host, sys.executable, str(HERE / 'offload.py'), 'eth0')
    run(*ip, 'address', 'add', address, 'dev', 'eth0')
    run(*ip, 'link', 'set', 'lo', 'up')
    run(*ip, 'link', 'set', 'eth0', 'up')
    run(*ip, 'route', 'add', 'default', 'dev', 'eth0')  # multicast takes it too


@contextmanager
def process(host: str, environment: dict[str, str], *command: str, shm: Path | None = None
            ) -> Iterator[None]:
    """Run Python on a host, with the host's shared memory; interrupt it at the end."""
    inside = f'mount --bind {shm} /dev/shm && exec "$0" "$@"' if shm else 'exec "$0" "$@"'
    started = subprocess.Popen(
        ['ip', 'netns', 'exec', host, 'sh', '-c', inside, sys.executable, *command],
        env={**os.environ, 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET', **environment})
    try:
        yield
        started.send_signal(signal.SIGINT)
        started.wait(timeout=20)
    finally:
        started.kill()
        started.wait()


def measure(transport: Transport, options: argparse.Namespace, folder: Path) -> dict[str, float]:
    """Run camera, node and listener; return what arrived."""
    sent, arrived = folder / 'sent', folder / 'arrived'
    for path in (sent, arrived):
        path.write_text('')
    size = '640x480x64'
    environment = transport.environment
    node = ('-m', 'stereo_refine_ros.refine_node', '--ros-args', '--log-level', 'error',
            '-p', 'matching.num_disparities:=64', *transport.node_args)
    camera = (str(CAMERA), '--rate', str(options.rate), '--size', size,
              '--stamps', str(sent))
    listener = (str(Path(__file__).resolve()), '--listen', str(arrived))
    with (process(FAR_HOST, environment, *listener, shm=folder / FAR_HOST),
          process(transport.node_host, environment, *node, shm=folder / transport.node_host),
          process(CAMERA_HOST, environment, *camera, shm=folder / CAMERA_HOST)):
        wait_for_lines(arrived, 3, options.start_timeout)
        start = time.time_ns()
        time.sleep(options.seconds)
        end = time.time_ns() - 1_000_000_000  # the last second may still be under way
        time.sleep(1.0)
    stamps = [int(line) for line in sent.read_text().split() if start <= int(line) < end]
    times = dict(map(int, line.split()) for line in arrived.read_text().splitlines())
    ages_ms = [(times[stamp] - stamp) * 1e-6 for stamp in stamps if stamp in times]
    return {'rate_in_hz': len(stamps) / ((end - start) * 1e-9),
            'arrived_percent': 100.0 * len(ages_ms) / max(len(stamps), 1),
            'age_p50_ms': percentile(ages_ms, 50), 'age_p95_ms': percentile(ages_ms, 95)}


def wait_for_lines(path: Path, count: int, timeout_s: float) -> None:
    """Wait until a file has so many lines; go on without when the time is over."""
    end = time.monotonic() + timeout_s
    while time.monotonic() < end and path.read_text().count('\n') < count:
        time.sleep(0.2)


def percentile(values: Sequence[float], rank: float) -> float:
    """Return a percentile; NaN of nothing."""
    return float(np.percentile(values, rank)) if values else float('nan')


def listen(path: Path) -> None:
    """Write stamp and time of arrival of every disparity, both in nanoseconds."""
    import rclpy
    from rclpy.executors import ExternalShutdownException
    from rclpy.qos import QoSProfile
    from stereo_msgs.msg import DisparityImage

    rclpy.init()
    node = rclpy.create_node('far_listener')
    with path.open('w', buffering=1, encoding='utf-8') as stream:
        def note(message: DisparityImage) -> None:
            stamp = message.header.stamp
            stream.write(f'{stamp.sec * 1_000_000_000 + stamp.nanosec} {time.time_ns()}\n')
        node.create_subscription(DisparityImage, 'disparity', note, QoSProfile(depth=1))
        try:
            rclpy.spin(node)
        except (KeyboardInterrupt, ExternalShutdownException):
            rclpy.try_shutdown()


def measure_link(link: str, options: argparse.Namespace) -> Iterator[dict[str, float | str]]:
    """Measure every transport that was asked for on one link."""
    with tempfile.TemporaryDirectory() as name, two_hosts(Path(name), *LINKS[link]):
        for transport in TRANSPORTS:
            if options.only is None or options.only in transport.name:
                figures = measure(transport, options, Path(name))
                print(f'{link}: {transport.name}: {figures}', file=sys.stderr, flush=True)
                yield {'link': link, 'transport': transport.name, **figures}


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seconds', type=float, default=20.0, help='how long to measure each')
    parser.add_argument('--rate', type=float, default=5.0, help='pairs a second')
    parser.add_argument('--start-timeout', type=float, default=30.0, help='seconds')
    parser.add_argument('--only', help='transports with this in their name')
    parser.add_argument('--json', type=Path, help='write the figures here as well')
    parser.add_argument('--listen', type=Path, help=argparse.SUPPRESS)
    return parser.parse_args()


def main() -> None:
    """Measure every transport on every link and print a table."""
    options = parse()
    if options.listen:
        listen(options.listen)
        return
    missing = [name for name in TOOLS if shutil.which(name) is None]
    if os.geteuid() != 0 or missing:
        sys.exit(f'two_hosts: needs root, and these: {", ".join(missing or TOOLS)}')
    rows = [row for link in LINKS for row in measure_link(link, options)]
    print('| link | transport | arrived | age, median | age, 95 % |\n'
          '| --- | --- | --- | --- | --- |')
    for row in rows:
        print(f'| {row["link"]} | {row["transport"]} | {row["arrived_percent"]:.0f} % '
              f'| {row["age_p50_ms"]:.0f} ms | {row["age_p95_ms"]:.0f} ms |')
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1) + '\n', encoding='utf-8')


if __name__ == '__main__':
    main()

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
Malformed messages through the conversions and through a real node's callbacks, in this process.

Conversions may return or raise `BadMessage`, nothing else, and what they return has to make
sense. The node must answer no harmful set with a disparity and every harmless one, must account
for each, and a good pair now and then must come out bit for bit as at the start. Address space
is limited, so an absurd size that is allocated is an error. Ends with 1 on any violation.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
import json
import logging
from pathlib import Path
import resource
import sys
import time
from typing import Any

from fuzz_conversions import fuzz_conversions, HEIGHT, Report, WIDTH
from malformed import (
    HARMFUL, HARMLESS, LEFT, LEFT_INFO, Messages, pick, PRELIMINARY, random_disparity, RIGHT,
    RIGHT_INFO)
from malformed_compressed import compress, spoil, SPOILS
import numpy as np
import psutil
from stereo_refine_ros.dds_domain import use_own_domain

EXTRA_BYTES = 3 << 30  # address space beyond that of the imports: threads take most of it
GOOD_EVERY = 50


class NodeUnderTest:
    """The real node in this process; callbacks are called as the executor would."""

    def __init__(self, method: str = 'sgbm', transport: str = 'raw') -> None:
        """Start the node and a listener that makes it subscribe."""
        import rclpy
        from rclpy.parameter import Parameter
        from rclpy.qos import QoSProfile
        from stereo_msgs.msg import DisparityImage
        from stereo_refine_ros.node.publishers import Publishers
        from stereo_refine_ros.node.refine_node import RefineNode
        self.published: dict[tuple[int, int], Any] = {}
        send = Publishers.publish

        def record(publishers: Publishers, topic: str, message: Any) -> None:
            if topic == 'disparity':
                stamp = message.header.stamp
                self.published[stamp.sec, stamp.nanosec] = message
            send(publishers, topic, message)
        Publishers.publish = record
        rclpy.init(args=['--ros-args', '--log-level', 'fatal'])
        self.node = RefineNode(parameter_overrides=[
            Parameter('matching.num_disparities', value=16),
            # Every frame for itself: only so does a good pair come out bit for bit.
            Parameter('temporal.enabled', value=False),
            Parameter('inputs.image_transport', value=transport),
            Parameter('matching.method', value=method)])
        self.listener = rclpy.create_node('listener')
        self.listener.create_subscription(
            DisparityImage, 'disparity', lambda _: None, QoSProfile(depth=1))
        self._spin = lambda: rclpy.spin_once(self.node, timeout_sec=0.1)
        while not list(self.node.subscriptions):
            self._spin()

    def close(self) -> None:
        """End node and listener."""
        import rclpy
        self.node.stop(5.0)
        self.node.destroy_node()
        self.listener.destroy_node()
        rclpy.try_shutdown()

    def feed(self, messages: Messages) -> None:
        """Hand a set of messages to the callbacks and wait until nothing is under way."""
        callbacks = {item.topic_name: item.callback for item in self.node.subscriptions}
        for topic, message in messages.items():
            callbacks[f'/{topic}'](message)
        self._wait()

    def _wait(self) -> None:
        end = time.monotonic() + 60.0
        while self.counts().in_flight or self.node._inputs.holds:
            if self.node._inputs.holds:
                self._spin()
            time.sleep(0.0005)
            if time.monotonic() > end:
                raise TimeoutError(f'pairs in flight for a minute: {self.counts()}')

    def counts(self) -> Any:
        """Return the node's own counters."""
        return self.node._counters.counts()


def good_set(stamp: int, external: bool) -> Messages:
    """Return a good set: a textured pair, shifted by 6 px."""
    from stereo_msgs.msg import DisparityImage
    from stereo_refine_ros.messages.images import fill_image
    from stereo_refine_ros.messages.scene import (
        camera_info_messages, image_message, nominal_geometry, scene_header)
    from builtin_interfaces.msg import Time
    wide = np.random.default_rng(7).integers(0, 256, (HEIGHT, WIDTH + 6, 3), np.uint8)
    time_stamp = Time(sec=1000 + stamp // 1000, nanosec=stamp % 1000 * 1_000_000)
    headers = [scene_header(Time(sec=time_stamp.sec, nanosec=time_stamp.nanosec))
               for _ in range(4)]
    infos = camera_info_messages(nominal_geometry(HEIGHT, WIDTH), HEIGHT, WIDTH, headers[0])
    infos[1].header = headers[1]
    found: Messages = {
        LEFT_INFO: infos[0], RIGHT_INFO: infos[1],
        LEFT: image_message(wide[:, :WIDTH], 'bgr8', headers[2]),
        RIGHT: image_message(wide[:, 6:], 'bgr8', headers[3])}
    if external:
        message = DisparityImage(f=100.0, t=0.1, min_disparity=0.0, max_disparity=15.0)
        fill_image(message.image, np.full((HEIGHT, WIDTH), 6.0, np.float32), '32FC1')
        message.header = scene_header(Time(sec=time_stamp.sec, nanosec=time_stamp.nanosec))
        found[PRELIMINARY] = message
    return found


def fuzz_node(count: int, rng: np.random.Generator) -> Report:
    """Feed `count` sets, each with one defect, and good ones between them."""
    report, node, reference = Report(), NodeUnderTest(), None
    try:
        for i in range(count):
            if i % GOOD_EVERY == 0:
                message = _answer(node, good_set(2 * i, False))
                report.expect(message is not None, f'good pair {i} was not answered')
                reference = reference or message
                report.expect(message is None or message.image.data == reference.image.data,
                              f'good pair {i} differs from the first')
            is_harmful = rng.random() < 0.75
            name = pick(rng, list(HARMFUL if is_harmful else HARMLESS))
            messages = good_set(2 * i + 1, False)
            (HARMFUL if is_harmful else HARMLESS)[name](messages, rng)
            message = _answer(node, messages)
            report.expect((message is None) == is_harmful,
                          f'set {i}: {name}: {"" if message else "not "}answered')
            _check_answer(report, message)
            report.outcomes[f'{"refused" if is_harmful else "answered"}: {name}'] += 1
        _account(report, node)
    finally:
        node.close()
    return report


def fuzz_external(count: int, rng: np.random.Generator) -> Report:
    """Feed `count` sets with somebody else's disparity, any field of it drawn."""
    report, node = Report(), NodeUnderTest('external')
    try:
        for i in range(count):
            messages = good_set(2 * i + 1, True)
            drawn = random_disparity(rng)
            drawn.header = messages[PRELIMINARY].header
            messages[PRELIMINARY] = drawn
            message = _answer(node, messages)
            _check_answer(report, message)
            report.outcomes['answered' if message else 'not answered'] += 1
            if i % GOOD_EVERY == 0:
                message = _answer(node, good_set(2 * i, True))
                values = [] if message is None else np.frombuffer(message.image.data, np.float32)
                report.expect(message is not None and abs(np.median(values) - 6.0) < 0.1,
                              f'good disparity {i} was not answered as 6 px')
        _account(report, node)
    finally:
        node.close()
    return report


def fuzz_compressed(count: int, rng: np.random.Generator) -> Report:
    """Feed `count` compressed sets: one in four whole, which must be answered, no other."""
    report, node = Report(), NodeUnderTest(transport='compressed')
    try:
        for i in range(count):
            messages = compress(good_set(2 * i + 1, False), rng)
            name = 'whole' if rng.random() < 0.25 else pick(rng, list(SPOILS))
            if name != 'whole':
                spoil(messages, name, rng)
            message = _answer(node, messages)
            report.expect((message is not None) == (name == 'whole'),
                          f'set {i}: {name}: {"" if message else "not "}answered')
            _check_answer(report, message)
            report.outcomes[f'{"answered" if message else "refused"}: {name}'] += 1
        _account(report, node)
    finally:
        node.close()
    return report


def _answer(node: NodeUnderTest, messages: Messages) -> Any:
    """Return the disparity that the node published for a set, None if there was none."""
    node.published.clear()
    node.feed(messages)
    return next(iter(node.published.values()), None)


def _check_answer(report: Report, message: Any) -> None:
    """Whatever was in, what comes out has to be a disparity message that can be used."""
    if message is None:
        return
    values = np.frombuffer(message.image.data, np.float32)
    report.expect(values.size == WIDTH * HEIGHT and bool((np.abs(values) < 1e6).all()),
                  'published values are not finite or absurd')
    report.expect(bool((values >= message.min_disparity - 1.001).all()), 'below the mark')
    is_unknown = message.f == message.t == 0.0
    report.expect(is_unknown or (0 < message.f < 1e6 and 0 < message.t < 1e6),
                  f'f {message.f} t {message.t}')


def _account(report: Report, node: NodeUnderTest) -> None:
    counts = node.counts()
    report.outcomes.update({f'counted: {key}': value for key, value in counts.refused.items()})
    report.outcomes.update({'counted: published': counts.published})
    report.expect(counts.received == counts.published + counts.superseded
                  + sum(counts.refused.values()), f'accounts do not balance: {counts}')
    report.expect(counts.failures == 0, f'{counts.failures} exceptions in the processing')


def limit_memory() -> None:
    """Let the process take `EXTRA_BYTES` of address space beyond what it has."""
    limit = psutil.Process().memory_info().vms + EXTRA_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


def main(args: list[str] | None = None) -> int:
    """Fuzz and print the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--count', type=int, default=60000, help='messages for the conversions')
    parser.add_argument('--sets', type=int, default=20000, help='sets for the node')
    parser.add_argument('--external', type=int, default=5000, help='sets with a disparity')
    parser.add_argument('--compressed', type=int, default=5000, help='sets of compressed images')
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--json', type=Path, help='write the counts here as well')
    options = parser.parse_args(args)
    use_own_domain()
    logging.captureWarnings(True)
    limit_memory()
    reports = {}
    parts: dict[str, tuple[Callable[..., Report], int]] = {
        'conversions': (fuzz_conversions, options.count), 'node': (fuzz_node, options.sets),
        'external': (fuzz_external, options.external),
        'compressed': (fuzz_compressed, options.compressed)}
    for name, (fuzz, count) in parts.items():
        began = time.monotonic()
        reports[name] = report = fuzz(count, np.random.default_rng(options.seed))
        print(f'\n{name}: {count} in {time.monotonic() - began:.0f} s')
        print('\n'.join(f'{number:8d}  {key}' for key, number in sorted(report.outcomes.items())))
        print('\n'.join(report.violations), end='')
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f'\npeak memory {peak_mb:.0f} MB')
    if options.json:
        options.json.write_text(json.dumps({name: report.outcomes for name, report
                                            in reports.items()}, indent=2), encoding='utf-8')
    return int(any(report.violations for report in reports.values()))


if __name__ == '__main__':
    sys.exit(main())

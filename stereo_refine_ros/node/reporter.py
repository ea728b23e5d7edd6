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

"""Once a second: how things are, on /diagnostics and in the log."""

from __future__ import annotations

from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.qos_overriding_options import QoSOverridingOptions

from stereo_refine_ros.node.counters import Counts, FrameCounters
from stereo_refine_ros.node.diagnostics import (
    diagnostic_array, diagnostic_status, FrameSummary, Health)
from stereo_refine_ros.node.graph import explain_silence, feedback, rivals
from stereo_refine_ros.node.inputs import Inputs
from stereo_refine_ros.node.pairing_advice import explain_unmatched
from stereo_refine_ros.node.publishers import TOPICS as OUTPUTS
from stereo_refine_ros.warm_up import CompilerWatch

MOST_EXPLAINED = 2  # silent topics: the others are silent for the same reason, as a rule


class Reporter:
    """
    Compare the counters of now with those of a second ago, and say what follows.

    Parameters
    ----------
    node : rclpy.node.Node
    counters : FrameCounters
    inputs : Inputs
    warn : callable of a key and a text
        Logs, throttled by key.

    """

    def __init__(self, node: Node, counters: FrameCounters, inputs: Inputs,
                 warn: Callable[[str, str], None]) -> None:
        """Create the publisher of /diagnostics."""
        self._node = node
        self._counters = counters
        self._inputs = inputs
        self._warn = warn
        self._before = Counts()
        self._unmatched_before = 0
        self._received: dict[str, int] = {}
        self._rivals: tuple[str, ...] = ()
        self._incompatible: set[str] = set()
        self._compiler = CompilerWatch()
        self._publisher = node.create_publisher(
            DiagnosticArray, '/diagnostics', 10,
            qos_overriding_options=QoSOverridingOptions.with_default_policies())

    def incompatible(self, topic: str) -> None:
        """Take note of a publisher whose QoS does not fit."""
        self._incompatible.add(topic)
        self._warn(f'qos {topic}', f'{topic}: a publisher offers an incompatible QoS; '
                   'set qos_overrides or change the publisher')

    def report(self, ready: bool, last: FrameSummary) -> None:
        """Publish the diagnosis of the last second."""
        if not self._inputs.listening:
            self._incompatible.clear()
        self._rivals = tuple(rivals(self._node, OUTPUTS))
        health = self._health(ready, last)
        status = diagnostic_status(
            f'{self._node.get_fully_qualified_name()}: stereo refinement',
            last.frame_id or 'stereo camera', health)
        self._publisher.publish(
            diagnostic_array(self._node.get_clock().now().to_msg(), status))
        if health.silent:
            self._warn('silent', f'no input on {", ".join(health.silent)}: '
                       f'{"; ".join(health.silent_why)}')
        elif health.unmatched > health.unmatched_before:
            self._warn('unmatched', f'pairs are not complete: {health.unmatched_why}')
        for text in health.feedback + self._rivals:
            self._warn(text, text)
        self._before, self._unmatched_before = health.now, health.unmatched

    def _health(self, ready: bool, last: FrameSummary) -> Health:
        inputs = self._inputs
        silent = inputs.silent_topics()
        unmatched = inputs.unmatched
        return Health(
            listening=inputs.listening, ready=ready,
            compiling=self._compiler.has_worked(), now=self._counters.counts(),
            before=self._before, silent=tuple(map(inputs.full_name, silent)),
            silent_why=self._ask_graph(silent),
            feedback=tuple(feedback(self._node, inputs.topics())),
            incompatible=tuple(sorted(self._incompatible & set(silent))),
            unmatched=unmatched,
            # What does not pair while publishers are being found is nobody's fault.
            unmatched_before=unmatched if inputs.is_starting else self._unmatched_before,
            unmatched_why=explain_unmatched(inputs.pairing, self._rates()),
            fps=self._counters.fps(), latency_ms=last.latency_ms, valid_ratio=last.valid_ratio,
            advice=last.advice if inputs.listening else (),
            notes=(last.notes if inputs.listening else ()) + self._rivals)

    def _ask_graph(self, silent: list[str]) -> tuple[str, ...]:
        return tuple(explain_silence(self._node, topic, *self._inputs.source(topic))
                     for topic in silent[:MOST_EXPLAINED])

    def _rates(self) -> dict[str, int]:
        """Count what the required topics delivered since the last report."""
        received = {name: self._inputs.pairing.topics[name].received
                    for name in self._inputs.pairing.required}
        rates = {name: count - min(self._received.get(name, 0), count)
                 for name, count in received.items()}
        self._received = received
        return rates

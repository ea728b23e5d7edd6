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

"""The live node: wiring of parameters, inputs, worker, outputs and diagnostics."""

from __future__ import annotations

from collections.abc import Callable
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos_overriding_options import QoSOverridingOptions
from std_msgs.msg import Header

from stereo_refine_ros.encodings import BadMessage
from stereo_refine_ros.node.diagnostics import (
    ADVICE, describe_lag, diagnostic_array, diagnostic_status, Health)
from stereo_refine_ros.node.frame import Calibration, check_frame, Frame
from stereo_refine_ros.node.inputs import Inputs
from stereo_refine_ros.node.ledger import Counts, Ledger, Throttle
from stereo_refine_ros.node.parameters import NodeParameters
from stereo_refine_ros.node.processing import FrameProcessor, Surroundings
from stereo_refine_ros.node.publishers import Publishers
from stereo_refine_ros.node.worker import Afterwork, Worker
from stereo_refine_ros.pairing import MessageSet
from stereo_refine_ros.params import Params

WARN_PERIOD_S = 10.0
_HOLD_TICK_S = 0.02


class RefineNode(Node):
    """
    Pair messages, hand the newest pair to the worker, say how things are once a second.

    Callbacks run in one executor thread and never raise; the worker threads decode, refine
    and publish. What they share is the newest-frame slot, the ledger and one immutable
    `Params`, replaced as a whole.
    """

    def __init__(self, **node_options: Any) -> None:
        """Declare parameters, create publishers and timers, and start the worker."""
        super().__init__('refine_node', **node_options)
        self._started = time.monotonic()
        self._throttle = Throttle(WARN_PERIOD_S)
        self._ledger = Ledger()
        self._before = Counts()
        self._unmatched_before = 0
        self._incompatible: set[str] = set()
        self._ready = False
        self._stopping = False
        self._settings = NodeParameters(self, self._on_parameters)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._hold_timer = self.create_timer(
            _HOLD_TICK_S, self._guarded(self._release), clock=steady)
        self._hold_timer.cancel()
        self._inputs = Inputs(self, self._settings.current, self._on_set,
                              self._hold_timer.reset, self._on_incompatible)
        self._outputs = Publishers(self, self._update_subscriptions)
        self._diagnostics = self.create_publisher(
            DiagnosticArray, '/diagnostics', 10,
            qos_overriding_options=QoSOverridingOptions.with_default_policies())
        self._processor = FrameProcessor(self._surroundings())
        self._worker: Worker[Frame] = Worker(
            self._prepare, self._processor.process, self._on_frame_error,
            self._in_flight)
        self.create_timer(1.0, self._guarded(self._tick), clock=steady)
        self._worker.start()

    def stop(self, timeout_s: float) -> bool:
        """Take no more frames; return whether the worker ended within the time."""
        self._stopping = True
        return self._worker.stop(timeout_s)

    def _surroundings(self) -> Surroundings:
        return Surroundings(
            params=lambda: self._settings.current, publishers=self._outputs,
            ledger=self._ledger, age_ms=self._age_ms,
            unmatched=lambda: self._inputs.unmatched, on_refused=self._refuse,
            on_error=self._on_error, warn=self._warn,
            later=Afterwork(self._on_error).submit,
            name=f'{self.get_fully_qualified_name()}: metrics')

    def _in_flight(self) -> int:
        processing = self._settings.current.processing
        return min(processing.frames_in_flight, processing.threads)

    def _prepare(self) -> None:
        self.get_logger().info('compiling, half a minute at the first start, cached after it')
        try:
            self._processor.warm_up(lambda step: self.get_logger().info(f'compiling {step}'))
        except Exception as error:  # frames may still work, and say so each by itself
            self._on_error(error)
        self._ready = True
        self.get_logger().info(f'ready after {time.monotonic() - self._started:.1f} s')

    def _on_set(self, found: MessageSet, calibration: Calibration) -> None:
        """Check a complete set and leave it to the worker."""
        self._ledger.received()
        try:
            frame = check_frame(found, calibration)
        except BadMessage as error:
            self._refuse(error)
            return
        except Exception as error:  # every pair is accounted for, whatever it holds
            self._on_frame_error(error)
            return
        if self._worker.submit(frame) is not None:
            self._ledger.superseded()

    def _refuse(self, error: BadMessage) -> None:
        self._ledger.refused(error.reason)
        self._warn(error.reason, f'pair refused: {error} - {ADVICE.get(error.reason, "")}')

    def _on_frame_error(self, error: Exception) -> None:
        """Count a frame that ended in an exception as refused."""
        self._ledger.refused('processing')
        self._on_error(error)

    def _on_error(self, error: Exception) -> None:
        if self._stopping:
            return  # publishers vanish under the worker while the node ends
        self._ledger.failed()
        self._warn(f'error {type(error).__name__}',
                   f'processing failed: {type(error).__name__}: {error}')

    def _on_parameters(self, old: Params, new: Params) -> None:
        if old.sync != new.sync or old.matching.method != new.matching.method:
            self._inputs.configure(new)
            self._guarded(self._update_subscriptions)()

    def _on_incompatible(self, topic: str) -> None:
        self._incompatible.add(topic)
        self._warn(f'qos {topic}', f'{topic}: a publisher offers an incompatible QoS; '
                   'set qos_overrides or change the publisher')

    def _update_subscriptions(self) -> None:
        """Listen to inputs while somebody listens to an output."""
        self._inputs.listen(
            self._outputs.wants_any(), self._outputs.wants('metrics'))
        if not self._inputs.listening:
            self._incompatible.clear()

    def _release(self) -> None:
        self._hold_timer.cancel()
        self._inputs.release()  # starts the timer again while a set has to wait

    def _tick(self) -> None:
        """Report once a second."""
        self._update_subscriptions()
        health = self._health()
        status = diagnostic_status(
            f'{self.get_fully_qualified_name()}: stereo refinement',
            self._processor.last.frame_id or 'stereo camera', health)
        self._diagnostics.publish(
            diagnostic_array(self.get_clock().now().to_msg(), status))
        if health.silent:
            self._warn('silent', f'no input on {", ".join(health.silent)}: check names, '
                       'remappings and QoS')
        elif health.unmatched > health.unmatched_before:
            self._warn('unmatched', f'pairs are not complete: {health.lag}; check stamps, or '
                       'set sync.approximate and sync.slop')
        self._before, self._unmatched_before = health.now, health.unmatched

    def _health(self) -> Health:
        last, silent = self._processor.last, self._inputs.silent_topics()
        return Health(
            listening=self._inputs.listening, ready=self._ready, now=self._ledger.counts(),
            before=self._before, silent=tuple(map(self._inputs.full_name, silent)),
            incompatible=tuple(sorted(self._incompatible & set(silent))),
            unmatched=self._inputs.unmatched,
            unmatched_before=self._unmatched_before,
            lag=describe_lag(self._inputs.pairing), fps=self._ledger.fps(),
            latency_ms=last.latency_ms, valid_ratio=last.valid_ratio)

    def _age_ms(self, header: Header) -> float:
        # rclpy's own Time refuses stamps before 1970
        stamp_ns = header.stamp.sec * 1_000_000_000 + header.stamp.nanosec
        return (self.get_clock().now().nanoseconds - stamp_ns) / 1e6

    def _warn(self, key: str, text: str) -> None:
        if self._throttle.allows(key):
            self.get_logger().warning(text)

    def _guarded(self, callback: Callable[[], None]) -> Callable[[], None]:
        """Wrap a callback so that nothing it raises ends the executor."""
        def call() -> None:
            try:
                callback()
            except Exception as error:
                self._on_error(error)
        return call

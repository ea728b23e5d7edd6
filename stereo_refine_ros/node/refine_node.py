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

"""The live node, read downwards: messages come in, a frame is refined, results go out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import math
import sys
import time
from typing import Any

import cv2
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from std_msgs.msg import Header
from stereo_msgs.msg import DisparityImage

from stereo_refine_ros.decoding import PairDecoder
from stereo_refine_ros.encodings import BadMessage
from stereo_refine_ros.messages.disparity import disparity_message
from stereo_refine_ros.messages.metrics import metrics_message
from stereo_refine_ros.node.calibration import Calibration
from stereo_refine_ros.node.counters import FrameCounters, Throttle
from stereo_refine_ros.node.diagnostics import ADVICE, frame_status, FrameSummary
from stereo_refine_ros.node.frame import (
    check_frame, decode_frame, decode_truth, Frame, stamp_ns,
    with_declared_range, with_nearest)
from stereo_refine_ros.node.frame_refiner import FrameRefiner
from stereo_refine_ros.node.inputs import Inputs
from stereo_refine_ros.node.pair_watch import PairWatch
from stereo_refine_ros.node.parameter_advice import unused_files
from stereo_refine_ros.node.parameters import BadParameters, NodeParameters
from stereo_refine_ros.node.publishers import Publishers
from stereo_refine_ros.node.reporter import Reporter
from stereo_refine_ros.node.truth import TruthDesk
from stereo_refine_ros.node.views import missing_for, RefinedFrame, sure_part, VIEWS
from stereo_refine_ros.node.worker import Afterwork, Worker
from stereo_refine_ros.pairing import MessageSet
from stereo_refine_ros.params import Params
from stereo_refine_ros.quality.frame import confidence_figures, measure_frame
from stereo_refine_ros.warm_up import compile_apart, run_kernels

WARN_PERIOD_S = 10.0
_HOLD_TICK_S = 0.02


class RefineNode(Node):
    """
    Refine the newest pair of images; say how things are once a second.

    `on_messages` runs in the executor's thread, `refine` in up to two threads of the worker,
    `publish` in a third, in order of arrival; views and metrics are made in two more. What they
    share is the newest-frame slot, the counters and one immutable `Params`, replaced as a whole.
    No callback raises.
    """

    def __init__(self, **node_options: Any) -> None:
        """Declare parameters, create publishers and timers, and start the worker."""
        super().__init__('refine_node', automatically_declare_parameters_from_overrides=True,
                         **node_options)
        self._started = time.monotonic()
        self._throttle = Throttle(WARN_PERIOD_S)
        self._once = Throttle(math.inf)
        self._counters = FrameCounters()
        self._last = FrameSummary()
        self._ready = False
        self._stopping = False
        try:
            self._settings = NodeParameters(self, self._on_parameters)
        except BadParameters as error:
            self.get_logger().fatal(str(error))
            raise
        for text in unused_files(sys.argv, self.get_fully_qualified_name()):
            self.get_logger().warning(text)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._hold_timer = self.create_timer(
            _HOLD_TICK_S, self._guarded(self._release), clock=steady)
        self._hold_timer.cancel()
        self._truths: TruthDesk[RefinedFrame] = TruthDesk(
            self._publish_metrics, lambda: self._inputs.truth_is_published(), self._on_error)
        self._inputs = Inputs(
            self, self._settings.current, self.on_messages, self._truths.add_truth,
            self._hold_timer.reset, lambda topic: self._reporter.incompatible(topic))
        self._outputs = Publishers(self, self._update_subscriptions)
        self._reporter = Reporter(self, self._counters, self._inputs, self._warn)
        self._decoder = PairDecoder()
        self._refiner = FrameRefiner()
        self._watch = PairWatch()
        self._afterwork = Afterwork(self._on_error)
        self._worker: Worker[Frame, RefinedFrame] = Worker(
            self._prepare, self.refine, self.publish, self._on_frame_error, self._in_flight)
        self.create_timer(1.0, self._guarded(self._tick), clock=steady)
        self._worker.start()

    def stop(self, timeout_s: float) -> bool:
        """Take no more frames; return whether every thread ended within the time."""
        self._stopping = True
        end = time.monotonic() + timeout_s
        return all([part.stop(max(0.0, end - time.monotonic()))  # noqa: C419
                    for part in (self._truths, self._worker, self._afterwork)])

    # One frame, from its messages to what is made of it.

    def on_messages(self, found: MessageSet, calibration: Calibration) -> None:
        """Check a complete set and leave it to the worker."""
        self._counters.received()
        try:
            params = self._settings.current
            frame = check_frame(found, calibration, params.camera, params.inputs.rectify)
        except Exception as error:  # every pair is accounted for, whatever it holds
            self._on_frame_error(error)
            return
        for note in frame.notes:
            self._warn(note.key, note.text, once=True)
        if self._worker.submit(frame) is not None:
            self._counters.superseded()

    def refine(self, frame: Frame, is_alone: bool) -> RefinedFrame:
        """Decode a frame and refine it, on half the threads where another is in work."""
        params = self._settings.current
        threads = params.processing.threads if is_alone else params.processing.threads // 2
        decoded = decode_frame(frame, self._decoder)
        params = with_declared_range(
            with_nearest(params, decoded.geometry), decoded.search_range)
        result, failure = self._refiner.refine(
            decoded.pair, decoded.preliminary, params, max(1, threads))
        return RefinedFrame(frame, decoded, params, result,
                            sure_part(result, params.output.min_confidence), failure)

    def publish(self, refined: RefinedFrame) -> None:
        """Send the disparity now, and what else somebody listens to as soon as may be."""
        result, header = refined.result, refined.header
        self._outputs.publish(
            'disparity', disparity_message(refined.published, refined.decoded.geometry, header))
        self._counters.published()
        advice = tuple(self._watch.look(refined))
        self._last = FrameSummary(
            header.frame_id, self._age_ms(header), result.disparity.valid_ratio, advice,
            tuple(note.text for note in refined.frame.notes if note.is_lasting))
        self._report_troubles(refined)
        refined = replace(refined, figures=self._figures(refined), advice=advice)
        if self._outputs.wants('metrics'):
            self._truths.add_frame(refined.frame.stamp_ns, refined)
        self._afterwork.submit(lambda: self._publish_views(refined))

    def _publish_views(self, refined: RefinedFrame) -> None:
        """Make each further output that somebody listens to; one that fails costs itself."""
        for topic in VIEWS:
            if self._outputs.wants(topic):
                self._guarded(lambda topic=topic: self._publish_view(topic, refined))()

    def _publish_view(self, topic: str, refined: RefinedFrame) -> None:
        missing = missing_for(topic, refined)
        if missing:
            self._warn(f'no {topic}', f'{topic} is not published: {missing}')
            return
        self._outputs.publish(topic, VIEWS[topic](refined))

    def _publish_metrics(self, refined: RefinedFrame, truth: DisparityImage | None) -> None:
        """Measure a frame, also against its ground truth if that has come."""
        known: tuple[Any, ...] = ()
        try:
            known = () if truth is None else decode_truth(truth, refined.decoded)
        except BadMessage as error:
            self._warn(error.reason, str(error))
        measured = measure_frame(refined.result, refined.decoded.pair, *known)
        self._outputs.publish('metrics', metrics_message(
            refined.header, f'{self.get_fully_qualified_name()}: metrics',
            refined.header.frame_id,
            {**refined.figures, **measured, **confidence_figures(
                refined.result, refined.params.output.min_confidence)},
            *frame_status(refined.failure is not None, refined.advice)))

    def _figures(self, refined: RefinedFrame) -> dict[str, float]:
        """Take down what the metrics say of the moment of publishing."""
        counts = self._counters.counts()
        return {
            'frame_latency_ms': self._last.latency_ms, 'fps': self._counters.fps(),
            'frames_dropped': counts.superseded, 'pairs_unmatched': self._inputs.unmatched,
            'pairs_refused': sum(counts.refused.values()),
            'degraded': int(refined.failure is not None)}

    def _report_troubles(self, refined: RefinedFrame) -> None:
        if refined.failure is not None:
            self._counters.degraded()
            self._on_error(refined.failure)
        if refined.decoded.rescaled:
            self._warn('rescaled', 'preliminary/disparity differs in size from the left '
                       'image and is rescaled; publish both at one resolution')

    # The node around it.

    def _prepare(self) -> None:
        self.get_logger().info(
            'preparing kernels: compiling them takes about a minute once, then they are cached')

        def progress(step: str) -> None:
            self.get_logger().info(f'compiling {step}')
        try:
            params = self._settings.current
            cv2.setNumThreads(params.processing.threads)
            compile_apart(params, progress)
            run_kernels(params)
        except Exception as error:  # frames may still work, and say so each by itself
            self._on_error(error)
        self._ready = True
        self.get_logger().info(f'ready after {time.monotonic() - self._started:.1f} s')

    def _in_flight(self) -> int:
        processing = self._settings.current.processing
        return min(processing.frames_in_flight, processing.threads)

    def _on_frame_error(self, error: Exception) -> None:
        """Count a frame that ended in an exception as refused."""
        if isinstance(error, BadMessage):
            self._counters.refused(error.reason)
            self._warn(error.reason, f'pair refused: {error} - {ADVICE.get(error.reason, "")}')
        else:
            self._counters.refused('processing')
            self._on_error(error)

    def _on_error(self, error: Exception) -> None:
        if self._stopping:
            return  # publishers vanish under the worker while the node ends
        self._counters.failed()
        self._warn(f'error {type(error).__name__}',
                   f'processing failed: {type(error).__name__}: {error}')

    def _on_parameters(self, old: Params, new: Params) -> None:
        cv2.setNumThreads(new.processing.threads)
        if old.sync != new.sync or old.matching.method != new.matching.method \
                or old.camera != new.camera or old.inputs != new.inputs:
            self._inputs.configure(new)
            self._guarded(self._update_subscriptions)()

    def _update_subscriptions(self) -> None:
        """Listen to inputs while somebody listens to an output."""
        self._inputs.listen(
            self._outputs.wants_any(), self._outputs.wants('metrics'))

    def _release(self) -> None:
        self._hold_timer.cancel()
        self._inputs.release()  # starts the timer again while a set has to wait

    def _tick(self) -> None:
        """Report once a second."""
        self._update_subscriptions()
        self._reporter.report(self._ready, self._last)

    def _age_ms(self, header: Header) -> float:
        return (self.get_clock().now().nanoseconds - stamp_ns(header)) / 1e6

    def _warn(self, key: str, text: str, once: bool = False) -> None:
        if (self._once if once else self._throttle).allows(key):
            self.get_logger().warning(text)

    def _guarded(self, callback: Callable[[], None]) -> Callable[[], None]:
        """Wrap a callback so that nothing it raises ends the executor."""
        def call() -> None:
            try:
                callback()
            except Exception as error:
                self._on_error(error)
        return call

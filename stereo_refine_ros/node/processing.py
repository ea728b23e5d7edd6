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

"""What the worker does with one frame: decode, refine, publish, measure."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import math
import threading
import time
from typing import Any, Protocol

import cv2
import numpy as np
from std_msgs.msg import Header

from stereo_refine_ros.encodings import BadMessage
from stereo_refine_ros.matching import compute_match
from stereo_refine_ros.messages.disparity import disparity_message
from stereo_refine_ros.messages.metrics import metrics_message
from stereo_refine_ros.messages.outputs import color_map, depth_map, image_message, point_cloud
from stereo_refine_ros.messages.plane_markers import large_planes, plane_markers
from stereo_refine_ros.node.frame import decode_frame, decode_truth, DecodedFrame, Frame
from stereo_refine_ros.node.ledger import Ledger
from stereo_refine_ros.node.worker import FIRST, Turn
from stereo_refine_ros.params import Params
from stereo_refine_ros.pipeline import StereoRefiner
from stereo_refine_ros.quality.frame import measure_frame
from stereo_refine_ros.refinement.plane_stage import unfitted
from stereo_refine_ros.types import DisparityMap, RefinementResult
from stereo_refine_ros.warm_up import compile_apart, run_kernels

FAILURES_BEFORE_FALLBACK = 3
_STAGES = ('matching', 'segmentation', 'planes', 'filter')


@dataclass(frozen=True)
class FrameSummary:
    """What /diagnostics needs of the last frame."""

    frame_id: str = ''
    latency_ms: float = math.nan
    valid_ratio: float = math.nan
    is_degraded: bool = False


class Outlet(Protocol):
    """Where messages go: `Publishers`, or a stand-in for tests."""

    def wants(self, topic: str) -> bool:
        """Whether somebody listens."""

    def publish(self, topic: str, message: Any) -> None:
        """Send a message."""


@dataclass(frozen=True)
class Surroundings:
    """
    What the processor asks of the node around it.

    Attributes
    ----------
    params : callable returning the Params of the moment
    publishers : Outlet
    ledger : Ledger
    age_ms : callable of a Header, the milliseconds since its stamp
    unmatched : callable returning the pairs that were not complete
    on_refused : callable of BadMessage
    on_error : callable of Exception
    warn : callable of a key and a text, throttled by key
    later : callable of a task that publishes what may follow the disparity
    name : str
        Of the status in the metrics.

    """

    params: Callable[[], Params]
    publishers: Outlet
    ledger: Ledger
    age_ms: Callable[[Header], float]
    unmatched: Callable[[], int]
    on_refused: Callable[[BadMessage], None]
    on_error: Callable[[Exception], None]
    warn: Callable[[str, str], None]
    later: Callable[[Callable[[], None]], None]
    name: str = 'stereo_refine'


class FrameProcessor:
    """
    Refine frames, each in the thread that brings it, and publish them in their order.

    A refinement that raises costs its frame; after `FAILURES_BEFORE_FALLBACK` in a row the
    preliminary disparity goes out instead, marked in the metrics, until refining works again.
    """

    def __init__(self, around: Surroundings,
                 make_refiner: Callable[[Params], StereoRefiner] = StereoRefiner) -> None:
        """Keep the surroundings; kernels are compiled by `warm_up`."""
        self._around = around
        self._make_refiner = make_refiner
        self._refiner: StereoRefiner | None = None
        self._failures = 0
        self._counting = threading.Lock()
        self.last = FrameSummary()

    def warm_up(self, progress: Callable[[str], None] = lambda text: None) -> None:
        """Compile every kernel that the parameters of the moment use, on a small pair."""
        params = self._around.params()
        compile_apart(params, progress)
        run_kernels(params, lambda params, pair, preliminary: self._refine(
            DecodedFrame(pair, None, preliminary=preliminary), params,
            params.processing.threads))

    def process(self, frame: Frame, turn: Turn = FIRST) -> None:
        """Take one checked frame to its end, published (when it is its turn) or refused."""
        try:
            decoded = decode_frame(frame)
        except BadMessage as error:
            self._around.on_refused(error)
            return
        if decoded.rescaled:
            self._around.warn('rescaled', 'preliminary/disparity differs in size from the left '
                              'image and is rescaled; publish both at one resolution')
        params = self._around.params()
        threads = params.processing.threads
        result, is_degraded = self._refine_or_fall_back(
            decoded, params, threads if turn.is_alone else max(1, threads // 2))
        turn.wait()
        self._publish_disparity(frame, decoded, result, is_degraded)
        around = self._around
        counts = around.ledger.counts()
        figures = {
            'frame_latency_ms': self.last.latency_ms, 'fps': around.ledger.fps(),
            'frames_dropped': counts.superseded, 'pairs_unmatched': around.unmatched(),
            'pairs_refused': sum(counts.refused.values()), 'degraded': int(is_degraded)}
        around.later(lambda: self._publish_rest(frame, decoded, result, figures))

    def _refine_or_fall_back(self, decoded: DecodedFrame, params: Params, threads: int
                             ) -> tuple[RefinementResult, bool]:
        try:
            result = self._refine(decoded, params, threads)
        except Exception as error:
            with self._counting:
                self._failures += 1
                failures = self._failures
            if failures < FAILURES_BEFORE_FALLBACK:
                raise
            self._around.on_error(error)
            return _unrefined(decoded, params, threads), True
        with self._counting:
            self._failures = 0
        return result, False

    def _refine(self, decoded: DecodedFrame, params: Params, threads: int) -> RefinementResult:
        params = _with_range(params, decoded.search_range)
        refiner = self._refiner
        if refiner is None or refiner.params != params:
            cv2.setNumThreads(params.processing.threads)
            refiner = self._refiner = self._make_refiner(params)
        return refiner.process(
            decoded.pair.left, decoded.pair.right, decoded.preliminary, threads)

    def _publish_disparity(self, frame: Frame, decoded: DecodedFrame,
                           result: RefinementResult, is_degraded: bool) -> None:
        message = disparity_message(result.disparity, decoded.geometry, frame.header)
        self._around.publishers.publish('disparity', message)
        self._around.ledger.published()
        if is_degraded:
            self._around.ledger.degraded()
        self.last = FrameSummary(
            frame.header.frame_id, self._around.age_ms(frame.header),
            result.disparity.valid_ratio, is_degraded)

    def _publish_rest(self, frame: Frame, decoded: DecodedFrame, result: RefinementResult,
                      figures: dict[str, float]) -> None:
        """Publish views and metrics of a frame whose disparity is out and counted."""
        self._publish_views(frame, decoded, result)
        if self._around.publishers.wants('metrics'):
            self._publish_metrics(frame, decoded, result, figures)

    def _publish_views(self, frame: Frame, decoded: DecodedFrame, result: RefinementResult
                       ) -> None:
        """Make each further output that somebody listens to."""
        wants, publish = self._around.publishers.wants, self._around.publishers.publish
        header, geometry = frame.header, decoded.geometry
        if wants('disparity/preliminary'):
            publish('disparity/preliminary',
                    disparity_message(result.preliminary, geometry, header))
        if wants('disparity/color'):
            publish('disparity/color',
                    image_message(header, color_map(result.disparity), 'bgr8'))
        if wants('segments'):
            publish('segments', image_message(header, result.segments.labels, '32SC1'))
        if wants('depth'):
            publish('depth',
                    image_message(header, depth_map(result.disparity, geometry), '32FC1'))
        if wants('planes') and self._is_calibrated(decoded):
            publish('planes', plane_markers(header, large_planes(result.segments, geometry)))
        if wants('points') and self._is_calibrated(decoded):
            publish('points', point_cloud(
                header, depth_map(result.disparity, geometry), geometry, decoded.pair.left))

    def _is_calibrated(self, decoded: DecodedFrame) -> bool:
        if not decoded.has_principal_point:
            self._around.warn(
                'uncalibrated', 'planes and points need left and right camera_info')
        return decoded.has_principal_point

    def _publish_metrics(self, frame: Frame, decoded: DecodedFrame,
                         result: RefinementResult, figures: dict[str, float]) -> None:
        try:
            truth, scale = decode_truth(frame, decoded.geometry)
        except BadMessage as error:
            self._around.warn(error.reason, str(error))
            truth, scale = None, None
        figures = {**figures, **measure_frame(result, decoded.pair, truth, scale)}
        self._around.publishers.publish('metrics', metrics_message(
            frame.header, self._around.name, frame.header.frame_id, figures,
            bool(figures['degraded'])))


def _with_range(params: Params, search_range: tuple[int, int] | None) -> Params:
    """Take the search range that an external matcher declared, if parameters can hold it."""
    if search_range is None:
        return params
    try:
        return params.updated({'matching.min_disparity': search_range[0],
                               'matching.num_disparities': search_range[1]})
    except ValueError:
        return params


def _unrefined(decoded: DecodedFrame, params: Params, threads: int) -> RefinementResult:
    """Stand in for a refinement that fails: the preliminary disparity alone."""
    params = _with_range(params, decoded.search_range)
    matching = params.matching
    start = time.perf_counter()
    if decoded.preliminary is not None:
        disparity = DisparityMap(
            decoded.preliminary, matching.min_disparity, matching.num_disparities)
    else:
        disparity = compute_match(
            decoded.pair, matching, threads).disparity
    stage_ms = dict.fromkeys(_STAGES, 0.0)
    stage_ms['matching'] = (time.perf_counter() - start) * 1e3
    segments = unfitted(np.zeros(decoded.pair.shape, np.int32), 1)
    return RefinementResult(
        disparity, disparity, segments, math.nan,
        stage_ms, confidence=disparity.valid.astype(np.float32))

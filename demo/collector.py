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

"""The demo's own node: it subscribes to the outputs and keeps the newest whole frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import numpy as np
import rclpy
from rclpy.node import Node
from sensor_msgs.msg import Image
from stereo_msgs.msg import DisparityImage

from stereo_refine_ros.messages.disparity import read_disparity
from stereo_refine_ros.types import FloatMap, LabelMap

_KIND_OF: dict[str, Any] = {
    'disparity': DisparityImage, 'disparity/preliminary': DisparityImage, 'segments': Image,
    'confidence': Image, 'metrics': DiagnosticArray}
_DIAGNOSTICS, _OURS = '/diagnostics', ': stereo refinement'
_LEVELS = {DiagnosticStatus.WARN: 'WARN', DiagnosticStatus.ERROR: 'ERROR'}
_KEPT_FRAMES = 20


@dataclass(frozen=True, eq=False)
class DemoFrame:
    """
    What the node published for one pair.

    Attributes
    ----------
    preliminary, refined : float32 ndarray of shape (H, W)
        Metric disparities in pixels, NaN invalid.
    labels : int32 ndarray of shape (H, W)
        Segments.
    metrics : dict of str to float
    confidence : float32 ndarray of shape (H, W)
        Of the refined map, 0..1.

    """

    preliminary: FloatMap
    refined: FloatMap
    labels: LabelMap
    metrics: dict[str, float]
    confidence: FloatMap


class Collector(Node):
    """Collect the node's outputs by stamp."""

    def __init__(self) -> None:
        """Subscribe to the outputs."""
        super().__init__('demo')
        self.begin(with_truth=False)
        for topic, kind in _KIND_OF.items():
            self.create_subscription(kind, topic, self._keeper(topic), 10)
        self.create_subscription(DiagnosticArray, _DIAGNOSTICS, self._diagnose, 10)

    def begin(self, with_truth: bool) -> None:
        """Forget all frames up to now; `with_truth` keeps only frames measured against it."""
        now = self.get_clock().now().to_msg()
        self._since = (now.sec, now.nanosec)
        self._with_truth = with_truth
        self._by_stamp: dict[tuple[int, int], dict[str, Any]] = {}
        self._whole: dict[str, Any] | None = None
        self._verdict, self._diagnosis = DiagnosticStatus(), DiagnosticStatus()
        self.history: list[dict[str, float]] = []

    def spin_for(self, seconds: float) -> None:
        """Serve callbacks until one came or the time is over."""
        rclpy.spin_once(self, timeout_sec=seconds)

    @property
    def has_frame(self) -> bool:
        """Whether every output of some frame has come."""
        return self._whole is not None

    @property
    def advice(self) -> str:
        """Return level and text where the last frame or the last second was not good."""
        worst = max(self._diagnosis, self._verdict, key=lambda status: status.level)
        return f'{_LEVELS[worst.level]}: {worst.message}' if worst.level in _LEVELS else ''

    @property
    def frame(self) -> DemoFrame | None:
        """Return the newest frame of which every output came."""
        if self._whole is None:
            return None
        labels, confidence = self._whole['segments'], self._whole['confidence']
        return DemoFrame(
            read_disparity('disparity/preliminary', self._whole['disparity/preliminary']).values,
            read_disparity('disparity', self._whole['disparity']).values,
            np.frombuffer(labels.data, np.int32).reshape(labels.height, labels.width),
            _figures(self._whole['metrics']),
            np.frombuffer(confidence.data, np.float32).reshape(
                confidence.height, confidence.width))

    def _keeper(self, topic: str) -> Any:
        def keep(message: Any) -> None:
            stamp = (message.header.stamp.sec, message.header.stamp.nanosec)
            if stamp < self._since:
                return
            outputs = self._by_stamp.setdefault(stamp, {})
            outputs[topic] = message
            if topic == 'metrics':
                self._verdict = message.status[0]
                self._note(_figures(message))
            if _KIND_OF.keys() <= outputs.keys() and self._is_measured(outputs['metrics']):
                self._whole = outputs
            while len(self._by_stamp) > _KEPT_FRAMES:
                del self._by_stamp[next(iter(self._by_stamp))]
        return keep

    def _note(self, figures: dict[str, float]) -> None:
        """Keep the figures; the truth of a frame may have come too late to measure it."""
        if self.history and self._with_truth:
            figures = {**self.history[-1], **figures}
        self.history.append(figures)

    def _diagnose(self, message: DiagnosticArray) -> None:
        """Keep what the node says of the last second: others speak on this topic too."""
        # Before the first frame it misses its inputs, and rightly so.
        for status in message.status:
            if self.history and status.name.endswith(_OURS):
                self._diagnosis = status

    def _is_measured(self, metrics: DiagnosticArray) -> bool:
        return not self._with_truth or 'bad_1_0_refined' in _figures(metrics)


def _figures(message: DiagnosticArray) -> dict[str, float]:
    return {item.key: float(item.value) for status in message.status for item in status.values}

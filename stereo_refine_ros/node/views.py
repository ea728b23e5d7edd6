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

"""What is shown of a refined frame: one function for each topic that somebody may listen to."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from std_msgs.msg import Header

from stereo_refine_ros.health_advice import Advice
from stereo_refine_ros.messages.disparity import disparity_message
from stereo_refine_ros.messages.outputs import color_map, depth_map, image_message, point_cloud
from stereo_refine_ros.messages.plane_markers import large_planes, plane_markers
from stereo_refine_ros.node.frame import DecodedFrame, Frame
from stereo_refine_ros.params import Params
from stereo_refine_ros.types import DisparityMap, RefinementResult


@dataclass(frozen=True, eq=False)
class RefinedFrame:
    """
    A frame on its way out.

    Attributes
    ----------
    frame : Frame
        The messages.
    decoded : DecodedFrame
        Their pixels.
    params : Params
        What it was refined with.
    result : RefinementResult
    published : DisparityMap
        The part of `result.disparity` that is sure enough for `output.min_confidence`.
    failure : Exception or None
        Why `result` is the preliminary disparity alone.
    figures : dict of str to float
        What the metrics say of the moment of publishing.
    advice : tuple of Advice
        What is wrong with the cameras, the worst first.

    """

    frame: Frame
    decoded: DecodedFrame
    params: Params
    result: RefinementResult
    published: DisparityMap
    failure: Exception | None = None
    figures: dict[str, float] = field(default_factory=dict)
    advice: tuple[Advice, ...] = ()

    @property
    def header(self) -> Header:
        """Header of every output."""
        return self.frame.header


def sure_part(result: RefinementResult, min_confidence: float) -> DisparityMap:
    """Return the refined map with the pixels that are less sure than asked as invalid ones."""
    dense = result.disparity
    if min_confidence <= 0.0:
        return dense
    sure = result.confidence >= min_confidence
    return replace(dense, values=np.where(sure, dense.values, np.float32(np.nan)))


def _preliminary(refined: RefinedFrame) -> Any:
    return disparity_message(
        refined.result.preliminary, refined.decoded.geometry, refined.header)


def _color(refined: RefinedFrame) -> Any:
    return image_message(refined.header, color_map(refined.published), 'bgr8')


def _segments(refined: RefinedFrame) -> Any:
    return image_message(refined.header, refined.result.segments.labels, '32SC1')


def _depth(refined: RefinedFrame) -> Any:
    depth = depth_map(refined.published, refined.decoded.geometry)
    return image_message(refined.header, depth, '32FC1')


def _depth_info(refined: RefinedFrame) -> Any:
    info = copy(refined.frame.calibration.left)
    info.header = refined.header
    return info


def _planes(refined: RefinedFrame) -> Any:
    planes = large_planes(refined.result.segments, refined.decoded.geometry)
    return plane_markers(refined.header, planes)


def _points(refined: RefinedFrame) -> Any:
    decoded = refined.decoded
    depth = depth_map(refined.published, decoded.geometry)
    farthest = refined.params.output.max_depth
    if farthest > 0.0:
        depth[depth > farthest] = np.nan
    return point_cloud(refined.header, depth, decoded.geometry, decoded.pair.left)


VIEWS: dict[str, Callable[[RefinedFrame], Any]] = {
    'disparity/preliminary': _preliminary, 'disparity/color': _color,
    'confidence': lambda refined: image_message(
        refined.header, refined.result.confidence, '32FC1'),
    'segments': _segments, 'depth': _depth, 'depth/camera_info': _depth_info,
    'planes': _planes, 'points': _points}


def missing_for(topic: str, refined: RefinedFrame) -> str:
    """Say what a view would need and the frame does not have; an empty text if nothing."""
    decoded = refined.decoded
    if topic in ('depth', 'planes', 'points') and not decoded.has_depth:
        return ('focal length and baseline are not known; publish calibrated camera_info, or '
                'set camera.baseline and camera.focal_length')
    if topic in ('planes', 'points') and not decoded.has_principal_point:
        return 'it needs left and right camera_info'
    if topic == 'depth/camera_info' and refined.frame.calibration.left is None:
        return 'no left/camera_info came'
    return ''

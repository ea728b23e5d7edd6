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
The large planes of a frame as markers: outline and normal, metric, in the optical frame.

With x = f X / Z + cx and d + doffs = f B / Z, the disparity plane d = a x + b y + c becomes
a f X + b fy Y + (a cx + b cy + c + doffs) Z = f B.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
from geometry_msgs.msg import Point
import numpy as np
from numpy.typing import NDArray
from std_msgs.msg import Header
from stereo_refine_ros.types import PlaneSegmentation, StereoGeometry
from visualization_msgs.msg import Marker, MarkerArray

MIN_AREA_RATIO = 0.05  # floor, walls, tables; the planes of small segments are uncertain
MAX_PLANES = 32
_FARTHEST_M = 1000.0
# Okabe and Ito's colours, told apart by the colour-blind.
_COLORS = ((0.90, 0.62, 0.0), (0.34, 0.71, 0.91), (0.0, 0.62, 0.45), (0.94, 0.89, 0.26),
           (0.0, 0.45, 0.70), (0.84, 0.37, 0.0), (0.80, 0.47, 0.65))


@dataclass(frozen=True, eq=False)
class MetricPlane:
    """
    One plane in the left optical frame: normal . X = offset.

    Attributes
    ----------
    normal : float64 ndarray of shape (3,)
        Unit length, pointing towards the camera, so `offset_m` is negative.
    offset_m : float
    outline : float64 ndarray of shape (K, 3)
        Convex outline of the segment on the plane, in metres.

    """

    normal: NDArray[np.float64]
    offset_m: float
    outline: NDArray[np.float64]


def large_planes(segments: PlaneSegmentation, geometry: StereoGeometry) -> list[MetricPlane]:
    """
    Find the fitted planes of at least `MIN_AREA_RATIO` of the image, largest first.

    Segments that were merged have one plane in common and count as one.
    """
    fitted = np.flatnonzero(segments.is_fitted)
    planes, group = np.unique(segments.planes[fitted], axis=0, return_inverse=True)
    # One more group, the last, takes the pixels without a plane.
    group_of_label = np.full(len(segments.planes), len(planes))
    group_of_label[fitted] = group.ravel()
    groups = group_of_label[segments.labels]
    area = np.bincount(groups.ravel(), minlength=len(planes) + 1)[:-1]
    order = np.argsort(-area, kind='stable')
    chosen = order[area[order] >= MIN_AREA_RATIO * groups.size][:MAX_PLANES]
    found = [_metric_plane(planes[i], groups == i, geometry) for i in chosen]
    return [plane for plane in found if plane is not None]


def plane_markers(header: Header, planes: list[MetricPlane]) -> MarkerArray:
    """Draw an outline and an arrow along the normal for each plane; older ones are deleted."""
    array = MarkerArray(markers=[_marker(header, '', 0, Marker.DELETEALL)])
    for number, plane in enumerate(planes):
        outline = _marker(header, 'outline', number, Marker.LINE_STRIP)
        outline.scale.x = 0.01
        outline.points = [_point(row) for row in (*plane.outline, plane.outline[0])]
        normal = _marker(header, 'normal', number, Marker.ARROW)
        normal.scale.x, normal.scale.y, normal.scale.z = 0.02, 0.05, 0.05
        center = plane.outline.mean(axis=0)
        normal.points = [_point(center), _point(center + 0.25 * plane.normal)]
        array.markers += [outline, normal]
    return array


def _metric_plane(plane: NDArray[np.float64], mask: NDArray[np.bool_], geometry: StereoGeometry
                  ) -> MetricPlane | None:
    """Return None for a plane that leaves the space in front of the camera in its segment."""
    a, b, c = plane
    hull = cv2.convexHull(cv2.findNonZero(mask.astype(np.uint8)))
    corners = hull.reshape(-1, 2).astype(np.float64)
    factor = geometry.focal_px * geometry.baseline_m
    metric = corners @ (a, b) + c + geometry.doffs_px
    if len(corners) < 3 or metric.min() <= factor / _FARTHEST_M:
        return None
    depth = factor / metric
    outline = np.stack([(corners[:, 0] - geometry.cx_left) / geometry.focal_px * depth,
                        (corners[:, 1] - geometry.cy) / geometry.fy * depth, depth], axis=1)
    gradient = np.array([
        a * geometry.focal_px, b * geometry.fy,
        a * geometry.cx_left + b * geometry.cy + c + geometry.doffs_px])
    length = float(np.linalg.norm(gradient))
    return MetricPlane(-gradient / length, -factor / length, outline)


def _marker(header: Header, namespace: str, number: int, kind: int) -> Marker:
    marker = Marker(ns=namespace, id=number)
    marker.header.stamp, marker.header.frame_id = header.stamp, header.frame_id
    if kind == Marker.DELETEALL:
        marker.action = kind
        return marker
    marker.type, marker.action = kind, Marker.ADD
    marker.pose.orientation.w = 1.0
    marker.color.r, marker.color.g, marker.color.b = _COLORS[number % len(_COLORS)]
    marker.color.a = 1.0
    return marker


def _point(row: NDArray[np.float64]) -> Point:
    return Point(x=float(row[0]), y=float(row[1]), z=float(row[2]))

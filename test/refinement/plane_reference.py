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

"""Slow, obvious versions of the plane stage, on lists."""

from __future__ import annotations

import numpy as np

MAX_SLOPES = 0.7, 1.5
RIDGE = 30.0


def ridge_plane(points):
    """Solve least squares for points (x, y, d), slopes held by the ridge and limited."""
    centre = points.mean(axis=0)
    x, y, d = (points - centre).T
    matrix = np.array([[x @ x + RIDGE, x @ y], [x @ y, y @ y + RIDGE]])
    a, b = np.linalg.solve(matrix, [x @ d, y @ d])
    a = min(max(a, -MAX_SLOPES[0]), MAX_SLOPES[0])
    b = min(max(b, -MAX_SLOPES[1]), MAX_SLOPES[1])
    return np.array([a, b, centre[2] - a * centre[0] - b * centre[1]])


def residuals(points, plane):
    """Return the difference of every point from a plane."""
    return points[:, 2] - points[:, :2] @ plane[:2] - plane[2]


def merge(points, planes, trusted, pairs, rise):
    """Merge segments pair by pair, refitting to all their points; returns the planes."""
    group = {label: [label] for label in range(len(planes))}
    planes = [np.array(plane) for plane in planes]

    def together(members):
        return np.concatenate([points[label] for label in members])

    def rises(members, old, new):
        data = together(members)
        return np.mean(residuals(data, new) ** 2) - np.mean(residuals(data, old) ** 2) > rise

    for a, b in pairs:
        if not (trusted[a] and trusted[b]) or group[a] is group[b]:
            continue
        joint = ridge_plane(together(group[a] + group[b]))
        if rises(group[a], planes[a], joint) or rises(group[b], planes[b], joint):
            continue
        merged = group[a] + group[b]
        for label in merged:
            group[label], planes[label] = merged, joint
    return np.array(planes)


def adopt(planes, own, pairs, unlikeness, passes):
    """Pass planes on from neighbour to neighbour, the least unlike one first."""
    planes = np.where(own[:, None], planes, np.nan)
    has = own.copy()
    for _ in range(passes):
        gifts = {}
        for (a, b), value in zip(pairs.tolist(), unlikeness, strict=True):
            for taker, giver in ((a, b), (b, a)):
                if not has[taker] and has[giver] \
                        and value < gifts.get(taker, (np.inf, None))[0]:
                    gifts[taker] = value, giver
        for taker, (_, giver) in gifts.items():
            planes[taker] = planes[giver]
            has[taker] = True
    return planes

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

"""Slow, obvious versions of the segmentation and of the plane stage, on sets and lists."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stereo_refine_ros.matching.evidence import TOTAL_UNIT
from stereo_refine_ros.matching.robust_cost import COST_UNIT
from stereo_refine_ros.refinement import plane_selection, projection

STEPS = [(0, 1), (1, 0), (1, 1), (1, -1)]
MAX_SLOPES = 0.7, 1.5
RIDGE = 30.0


def sorted_edges(image, directions, weights=None):
    """List (weight, pixel, pixel) by weight; equal ones by direction, then in raster order."""
    height, width = image.shape[:2]
    values = image.reshape(height, width, -1).astype(int)
    edges = []
    for k, (dy, dx) in enumerate(STEPS[:directions]):
        for y in range(height - dy):
            for x in range(max(0, -dx), min(width, width - dx)):
                weight = np.abs(values[y, x] - values[y + dy, x + dx]).max() \
                    if weights is None else weights[y, x, k]
                edges.append((int(weight), (y, x), (y + dy, x + dx)))
    return sorted(edges, key=lambda edge: edge[0])


def segment(image, k, min_size, directions, weights=None):
    """Merge sets of pixels edge by edge; return labels in raster order and their number."""
    component = {pixel: frozenset([pixel]) for pixel in np.ndindex(image.shape[:2])}
    largest = {}

    def join(a, b):
        merged = component[a] | component[b]
        for pixel in merged:
            component[pixel] = merged
        return merged

    def limit(pixel):
        members = component[pixel]
        return np.float32(largest.get(members, 0)) + np.float32(k) / np.float32(len(members))

    edges = sorted_edges(image, directions, weights)
    for weight, a, b in edges:
        if component[a] is not component[b] and weight <= min(limit(a), limit(b)):
            largest[join(a, b)] = weight
    for _, a, b in edges:
        if component[a] is not component[b] \
                and min(len(component[a]), len(component[b])) < min_size:
            join(a, b)
    numbers = {}
    labels = np.array([[numbers.setdefault(component[y, x], len(numbers))
                        for x in range(image.shape[1])] for y in range(image.shape[0])])
    return labels, len(numbers)


def borders(labels, image):
    """Return {(low, high): (length, contrast, colour distance, middle x, middle y)}."""
    height, width = labels.shape
    image = image.astype(float)
    if image.ndim == 2:
        image = np.repeat(image[..., None], 3, axis=2)
    steps = {}
    for y, x in np.ndindex(height, width):
        for v, u in ((y, x + 1), (y + 1, x)):
            if v < height and u < width and labels[v, u] != labels[y, x]:
                pair = tuple(sorted((int(labels[y, x]), int(labels[v, u]))))
                change = np.abs(image[y, x] - image[v, u]).sum()
                steps.setdefault(pair, []).append((change, (x + u) / 2, (y + v) / 2))
    found = {}
    for (low, high), rows in steps.items():
        distance = np.abs(image[labels == low].mean(0) - image[labels == high].mean(0)).sum()
        contrast, x, y = np.mean(rows, axis=0)
        found[low, high] = len(rows), contrast, distance, x, y
    return found


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


def sampled_cost(volume, x, y, index, last):
    """Interpolate a volume of costs between two whole disparities."""
    low = int(index)
    high = min(low + 1, last)
    rest = index - low
    return float(volume[y, x, low]) * (1 - rest) + float(volume[y, x, high]) * rest


def projection_cost(evidence, values, blind_guess):
    """Return what the evidence says against every value of a map, in units of cost."""
    width, last = values.shape[1], evidence.num_disparities - 1
    costs = np.empty(values.shape)
    for y, x in np.ndindex(values.shape):
        d = float(values[y, x])
        partner = int(np.floor(x - d + 0.5)) if np.isfinite(d) else -1
        if not 0 <= partner < width:
            costs[y, x] = projection._INVISIBLE + blind_guess[y, x]
            continue
        is_seen = evidence.right[y, partner] >= 0
        seen = int(evidence.right[y, partner]) + evidence.min_disparity
        if is_seen and seen > d + 1:
            costs[y, x] = projection._INVISIBLE + blind_guess[y, x]
            continue
        index = min(max(d - evidence.min_disparity, 0), last)
        excess = sampled_cost(evidence.total, x, y, index, last) - evidence.least[y, x]
        costs[y, x] = min(excess / TOTAL_UNIT, projection._LARGEST_COST)
        if is_seen and seen < d - 1:
            costs[y, x] += projection._TRANSPARENT
    return costs


def is_hidden(evidence, values):
    """Mark the disparities that are out of the right view, or behind what it shows."""
    # Against no evidence but the right view, what is not hidden costs nothing.
    nothing = replace(evidence, total=np.zeros_like(evidence.total),
                      least=np.zeros_like(evidence.least))
    costs = projection_cost(nothing, values, np.zeros(values.shape))
    return costs == projection._INVISIBLE


def gain(evidence, proposed, other, is_given, inertia=0.0, is_trusted=False):
    """Return what another map costs less than the proposed one, 0 where they are alike."""
    blind_guess = np.where(is_given, 0.0, projection._BLIND_GUESS)
    kept = projection_cost(evidence, other, blind_guess)
    lower = projection_cost(evidence, proposed, np.zeros(other.shape)) - kept
    is_uncontested = (kept < projection._UNCONTESTED) & ~is_hidden(evidence, other)
    is_worth_it = is_given & (is_trusted | is_uncontested)
    is_other = np.abs(proposed - other) >= projection.ALIKE
    return np.where(is_other, lower + inertia * is_worth_it, 0.0).astype(np.float32)


def selection_cost(evidence, x, y, d, is_matched):
    """Return the cost of a plane's disparity at one pixel, in units of cost."""
    width, last = evidence.cost.shape[1], evidence.num_disparities - 1
    partner = int(np.floor(x - d + 0.5))
    if not 0 <= partner < width:
        return (plane_selection._CONTRADICTED if is_matched
                else plane_selection._INVISIBLE)
    seen = int(evidence.right[y, partner])
    if seen >= 0 and seen + evidence.min_disparity > d + 1 and not is_matched:
        return plane_selection._INVISIBLE
    index = d - evidence.min_disparity
    if not 0 <= index <= last:
        return plane_selection._CONTRADICTED
    return sampled_cost(evidence.cost, x, y, index, last) / COST_UNIT


def weigh(length, distance):
    """Return what a step of one pixel costs along a border."""
    return (plane_selection._SMOOTHNESS * length
            * np.exp(-distance / plane_selection._COLOR_SCALE))


def select(planes, labels, pairs, lengths, distances, middles, evidence, matched):
    """Try every neighbour's plane on every segment."""
    planes = planes.copy()

    def energy(label, plane):
        members = np.argwhere(labels == label)
        tried = members[::max(1, len(members) // plane_selection._SAMPLES)].tolist()
        data = sum(selection_cost(evidence, x, y, plane @ [x, y, 1.0], matched[y, x])
                   for y, x in tried) / len(tried) * len(members)
        for pair, length, distance, middle in zip(
                pairs, lengths, distances, middles, strict=True):
            if label in pair:
                other = planes[pair.sum() - label]
                if np.isfinite(other[0]):
                    step = abs((plane - other) @ [*middle, 1.0])
                    data += weigh(length, distance) * min(step, plane_selection._LARGEST_STEP)
        return data

    for label in range(len(planes)):
        options = [planes[label]] if np.isfinite(planes[label, 0]) else []
        options += [planes[pair.sum() - label] for pair in pairs if label in pair
                    and np.isfinite(planes[pair.sum() - label, 0])]
        if options:
            energies = [energy(label, plane) for plane in options]
            planes[label] = options[int(np.argmin(energies))].copy()
    return planes

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

"""Slow, obvious versions of the filters and checks, one window at a time."""

from __future__ import annotations

import numpy as np


def window(shape, y, x, radius):
    """List the pixels of a square window that lie in the image."""
    return [(v, u)
            for v in range(max(y - radius, 0), min(y + radius + 1, shape[0]))
            for u in range(max(x - radius, 0), min(x + radius + 1, shape[1]))]


def colour_distance(guide, a, b):
    """Return the mean absolute difference of the channels of two pixels."""
    return np.abs(guide[a].astype(float) - guide[b].astype(float)).mean()


def filter_windows(values, radius, combine):
    """Apply `combine(centre, neighbours)` to the valid pixels around every valid pixel."""
    filtered = np.full(values.shape, np.nan)
    for y, x in np.argwhere(np.isfinite(values)):
        neighbours = [p for p in window(values.shape, y, x, radius) if np.isfinite(values[p])]
        filtered[y, x] = combine((y, x), neighbours)
    return filtered


def box(values, radius):
    """Average the valid pixels of every window."""
    return filter_windows(values, radius, lambda _, near: np.mean([values[p] for p in near]))


def weighted_median_range(values, guide, radius, sigma_color, sigma_space, slack):
    """
    Return the lowest and the highest weighted median.

    They differ where the weights fall into halves up to a share `slack` of rounding.
    """
    def medians(centre, near, share):
        order = sorted(near, key=lambda p: values[p])
        weights = np.array([
            space(centre, p, sigma_space)
            * max(0.0, 1 - colour_distance(guide, centre, p) / (4 * sigma_color)) ** 2
            for p in order])
        below = np.cumsum(weights) / weights.sum()
        return values[order[int(np.searchsorted(below, share))]]

    low = filter_windows(values, radius, lambda c, near: medians(c, near, 0.5 - slack))
    high = filter_windows(values, radius, lambda c, near: medians(c, near, 0.5 + slack))
    return low, high


def space(a, b, sigma):
    """Weigh two pixels by their distance."""
    return np.exp(-((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2) / (2 * sigma ** 2))


def trilateral(values, guide, radius, sigma_color, sigma_space, sigma_disparity):
    """Average with Gaussian weights of space, colour and disparity."""
    def average(centre, near):
        weights = [
            space(centre, p, sigma_space)
            * np.exp(-0.5 * (colour_distance(guide, centre, p) / sigma_color) ** 2)
            * np.exp(-0.5 * ((values[p] - values[centre]) / sigma_disparity) ** 2)
            * (abs(values[p] - values[centre]) < 4 * sigma_disparity)
            for p in near]
        return np.average([values[p] for p in near], weights=weights)

    return filter_windows(values, radius, average)


def guided(values, grey, radius, eps):
    """Run the guided filter window by window: fit a line, then average the lines."""
    level = grey / 255.0
    lines = {}
    for y in range(values.shape[0]):
        for x in range(values.shape[1]):
            near = [p for p in window(values.shape, y, x, radius) if np.isfinite(values[p])]
            if near:
                guide = np.array([level[p] for p in near])
                data = np.array([values[p] for p in near])
                covariance = np.mean(guide * data) - guide.mean() * data.mean()
                slope = covariance / (guide.var() + eps)
                lines[y, x] = slope, data.mean() - slope * guide.mean()

    def combine(centre, near):
        slope, intercept = np.mean([lines[p] for p in near], axis=0)
        return slope * level[centre] + intercept

    return filter_windows(values, radius, combine)

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

"""Slow, obvious versions of the truncated cost and of scanline optimisation."""

from __future__ import annotations

import numpy as np


def grey_of(image):
    """Return the luma of a BGR image, rounded as OpenCV rounds it; a grey one as it is."""
    if image.ndim == 2:
        return image.astype(int)
    weights = np.array([1868, 9617, 4899])
    return (image.astype(int) @ weights + (1 << 13)) >> 14


def census_bits(grey, y, x):
    """List the 24 comparisons of a 5x5 window: whether a neighbour is darker than the centre."""
    height, width = grey.shape
    return [
        bool(grey[min(max(y + dy, 0), height - 1), min(max(x + dx, 0), width - 1)] < grey[y, x])
        for dy in range(-2, 3) for dx in range(-2, 3) if (dy, dx) != (0, 0)]


def gradient(grey, y, x):
    """Return the differences across a pixel, 0 at the border."""
    height, width = grey.shape
    across = grey[y, x + 1] - grey[y, x - 1] if 0 < x < width - 1 else 0
    down = grey[y + 1, x] - grey[y - 1, x] if 0 < y < height - 1 else 0
    return np.array([across, down])


def robust_cost(left, right, min_disparity, num_disparities, unit):
    """Return the cost in exact arithmetic, in 1 / unit; 0.9 of a unit out of view."""
    height, width = left.shape[:2]
    greys = grey_of(left), grey_of(right)
    gray3 = [np.repeat(image[..., None], 3, 2) if image.ndim == 2 else image
             for image in (left, right)]
    colors = [image.astype(int) for image in gray3]
    volume = np.full((height, width, num_disparities), 0.9 * unit)
    for y in range(height):
        bits = [[census_bits(grey, y, x) for x in range(width)] for grey in greys]
        slopes = [[gradient(grey, y, x) for x in range(width)] for grey in greys]
        for x in range(width):
            for k in range(num_disparities):
                u = x - min_disparity - k
                if not 0 <= u < width:
                    continue
                color = np.abs(colors[0][y, x] - colors[1][y, u]).sum()
                census = sum(a != b for a, b in zip(bits[0][x], bits[1][u], strict=True))
                slope = np.abs(slopes[0][x] - slopes[1][u]).sum()
                volume[y, x, k] = 2 / 3 * unit * (
                    min(color, 75) / 75 + min(census, 14) / 14 + min(slope, 14) / 14)
    return volume


def is_edge(image, a, b, threshold):
    """Tell whether some channel changes by the threshold or more between two pixels."""
    return bool(np.abs(image[a].astype(int) - image[b].astype(int)).max() >= threshold)


def path_sums(left, right, cost, min_disparity, threshold, penalty):
    """
    Sum the four paths, one pixel after the other.

    `penalty(left_edge, right_edge, is_down)` returns P1 and P2.
    """
    height, width, depth = cost.shape
    total = np.zeros(cost.shape, int)
    for dy, dx in ((0, 1), (0, -1), (1, 0), (-1, 0)):
        path = np.zeros(cost.shape, int)
        rows = range(height) if dy >= 0 else range(height - 1, -1, -1)
        columns = range(width) if dx >= 0 else range(width - 1, -1, -1)
        for y in rows:
            for x in columns:
                before = (y - dy, x - dx)
                if not (0 <= before[0] < height and 0 <= before[1] < width):
                    path[y, x] = cost[y, x]
                    continue
                left_edge = is_edge(left, (y, x), before, threshold)
                for k in range(depth):
                    right_edge = edge_in_right_view(
                        right, (y, x), (dy, dx), min_disparity + k, threshold)
                    small, large = penalty(left_edge, right_edge, dy != 0)
                    choices = [path[before][k], path[before].min() + large]
                    choices += [path[before][j] + small for j in (k - 1, k + 1) if 0 <= j < depth]
                    path[y, x, k] = cost[y, x, k] + min(choices) - path[before].min()
        total += path
    return total


def edge_in_right_view(right, pixel, step, disparity, threshold):
    """
    Tell whether the right view has an edge where a step of the path comes to lie.

    Out of view there is none.
    """
    y, x = pixel[0], pixel[1] - disparity
    v, u = y - step[0], x - step[1]
    if min(x, u) < 0 or max(x, u) >= right.shape[1]:
        return False
    return is_edge(right, (y, x), (v, u), threshold)


def right_winners(total, min_disparity):
    """Search the diagonal of every right pixel for the least sum; -1 where it is empty."""
    height, width, depth = total.shape
    winners = np.full((height, width), -1)
    for y in range(height):
        for u in range(width):
            reached = [(total[y, u + min_disparity + k, k], k) for k in range(depth)
                       if 0 <= u + min_disparity + k < width]
            if reached:
                winners[y, u] = min(reached)[1]
    return winners


def subpixel(total, index):
    """Return where two lines of opposite slope through an index and its neighbours meet."""
    if not 0 < index < len(total) - 1:
        return float(index)
    before, here, after = (float(total[index + i]) for i in (-1, 0, 1))
    slope = max(before, after) - here
    return index + (0.5 * (before - after) / slope if slope > 0 else 0.0)


def islands(winners, stable, largest):
    """Mark stable pixels whose 4-connected region, by steps of at most 1, is that small."""
    seen, small = set(), np.zeros(stable.shape, bool)
    for seed in map(tuple, np.argwhere(stable)):
        if seed in seen:
            continue
        region, rest = {seed}, [seed]
        while rest:
            y, x = rest.pop()
            for near in ((y - 1, x), (y + 1, x), (y, x - 1), (y, x + 1)):
                if (0 <= near[0] < stable.shape[0] and 0 <= near[1] < stable.shape[1]
                        and stable[near] and near not in region
                        and abs(winners[near] - winners[y, x]) <= 1):
                    region.add(near)
                    rest.append(near)
        seen |= region
        if len(region) <= largest:
            small[tuple(np.array(sorted(region)).T)] = True
    return small

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

"""The scanline matcher written out pixel by pixel, on lists and dictionaries."""

from __future__ import annotations

import numpy as np

BAND_ROWS, STRIP, RUN_UP = 144, 48, 12
GRADIENT_CAP, CENSUS_CAP, OUT_OF_VIEW = 14, 20, 22
# By axis, then by whether the step is flat.
PENALTIES = {'row': {True: (55, 147), False: (6, 15)},
             'column': {True: (33, 114), False: (3, 11)}}
WALL, COST_WEIGHT = 255, 20


def features(grey):
    """Return (gradients, census bits) of every pixel; the view goes on as it ends."""
    height, width = grey.shape

    def at(image, y, x):
        return int(image[min(max(y, 0), height - 1), min(max(x, 0), width - 1)])

    def of(y, x):
        slopes = [at(grey, y, x + 1) - at(grey, y, x - 1), at(grey, y + 1, x) - at(grey, y - 1, x)]
        bits = [at(grey, y + i * step, x + j * step) < at(grey, y, x)
                for step in (1, 3) for i in range(-2, 3) for j in range(-2, 3) if i or j]
        return [min(max(slope, -127), 127) for slope in slopes], np.array(bits)
    return [[of(y, x) for x in range(width)] for y in range(height)]


def counted(image, edge_step):
    """Return which bits of both censuses count: of the second, pixels across no edge."""
    height, width = image.shape[:2]

    def of(y, x):
        places = [(min(max(y + 3 * i, 0), height - 1), min(max(x + 3 * j, 0), width - 1))
                  for i in range(-2, 3) for j in range(-2, 3) if i or j]
        return np.array([1] * 24 + [is_flat(image, (y, x), p, edge_step) for p in places])
    return [[of(y, x) for x in range(width)] for y in range(height)]


def pixel_cost(here, there, counts):
    slopes = sum(abs(a - b) for a, b in zip(here[0], there[0], strict=True))
    bits = int(((here[1] != there[1]) & (counts > 0)).sum())
    return min(slopes, GRADIENT_CAP) + min(bits, CENSUS_CAP)


def cost_volume(left, right, counts, disparities):
    """Return {disparity: cost} of every pixel; disparities(y, x) are the ones it looks at."""
    height, width = len(left), len(left[0])
    return [[{d: pixel_cost(left[y][x], right[y][x - d], counts[y][x])
              if 0 <= x - d < width else OUT_OF_VIEW
              for d in disparities(y, x)} for x in range(width)] for y in range(height)]


def is_flat(image, p, q, edge_step):
    return np.abs(image[p].astype(int) - image[q].astype(int)).max() < edge_step


def advance(before, cost, small, large, sees_beyond):
    """Return C + min(L, L(d +- 1) + P1, P2), less its least; L is a wall outside a window."""
    after = {}
    for d, value in cost.items():
        sees = d in before or sees_beyond
        beside = [before.get(n, WALL) for n in (d - 1, d + 1)] if sees else []
        best = min([before.get(d, WALL), large, *[n + small for n in beside]])
        after[d] = min(value + best, WALL)
    return less_its_least(after)


def less_its_least(values):
    least = min(values.values())
    return {d: value - least for d, value in values.items()}


def path(image, costs, pixels, kind, edge_step):
    """Return the values of a path at its pixels, in the order of its steps."""
    values = [less_its_least(costs[pixels[0][0]][pixels[0][1]])]
    for before, here in zip(pixels, pixels[1:], strict=False):
        small, large = PENALTIES[kind][bool(is_flat(image, before, here, edge_step))]
        values.append(advance(values[-1], costs[here[0]][here[1]], small, large,
                              kind == 'column'))
    return dict(zip(pixels, values, strict=True))


def strips(height):
    """Yield (band start, strip start, strip end)."""
    for start in range(0, height, BAND_ROWS):
        stop = min(start + BAND_ROWS, height)
        for top in range(start, stop, STRIP):
            yield start, top, min(top + STRIP, stop)


def path_sums(image, costs, edge_step):
    """Return the sum of the four paths at every pixel."""
    height, width = len(costs), len(costs[0])
    sums = {}
    for start, top, end in strips(height):
        for y in range(top, end):
            along = [(y, x) for x in range(width)]
            rows = (path(image, costs, along, 'row', edge_step),
                    path(image, costs, along[::-1], 'row', edge_step))
            for p in along:
                sums[p] = {d: rows[0][p][d] + rows[1][p][d] for d in rows[0][p]}
        for x in range(width):
            down = [(y, x) for y in range(max(0, start - RUN_UP), end)]
            up = [(y, x) for y in range(min(end + RUN_UP, height) - 1, top - 1, -1)]
            for values in (path(image, costs, way, 'column', edge_step) for way in (down, up)):
                for y in range(top, end):
                    for d in sums[y, x]:
                        sums[y, x][d] += values[y, x][d]
    return {p: {d: min(total, WALL) for d, total in of_pixel.items()}
            for p, of_pixel in sums.items()}


def subpixel(sums, d):
    if d - 1 not in sums or d + 1 not in sums:
        return float(d)
    below, above = sums[d - 1] - sums[d], sums[d + 1] - sums[d]
    return d + 0.5 * (below - above) / max(below, above, 1)


def finish(sums, costs, shape):
    """Return disparity, uniqueness and the right view's disparity."""
    disparity, uniqueness, right = np.full((3, *shape), np.nan)
    winners = {p: min(values, key=lambda d, v=values: (v[d], d)) for p, values in sums.items()}
    for y in range(shape[0]):
        claims = {}
        for x in range(shape[1]):
            d = winners[y, x]
            claim = (sums[y, x][d] + COST_WEIGHT * costs[y][x][d], x, d)
            if 0 <= x - d < shape[1]:
                claims[x - d] = min(claims.get(x - d, claim), claim)
        for partner, (_, _, d) in claims.items():
            right[y, partner] = d
        for x in range(shape[1]):
            d, values = winners[y, x], sums[y, x]
            far = [WALL, *[values[n] for n in values if abs(n - d) > 2]]
            uniqueness[y, x] = min((min(far) - values[d]) / 100, 2)
            is_agreed = x - d in claims and claims[x - d][2] == d
            if is_agreed and uniqueness[y, x] > 0:
                disparity[y, x] = subpixel(values, d)
    return disparity, uniqueness, right

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

"""The features of the likelihood model, pixel by pixel, and what the model makes of them."""

from numba import njit
import numpy as np

from stereo_refine_ros.refinement.tuning import ALIKE, COLOR_SCALE, STEP

NONE = np.float32(-1e6)  # stands for a missing disparity where NaN would cost time


@njit(cache=True, nogil=True)
def roughness_kernel(values, bend):
    one, twice = np.float32(1), np.float32(2)
    for y in range(1, values.shape[0] - 1):
        up, here, down = values[y - 1], values[y], values[y + 1]
        for x in range(1, values.shape[1] - 1):
            across = abs(here[x - 1] + here[x + 1] - twice * here[x])
            along = abs(up[x] + down[x] - twice * here[x])
            total = np.float32(0.5) * (min(across, one) + min(along, one))
            # A minimum may lose a NaN; their sum does not.
            bend[y, x] = total if across + along >= 0 else np.float32(np.nan)


@njit(cache=True, nogil=True, error_model='numpy')
def judge_kernel(start, stop, maps, given, plane, quality, fine, inside, coarse, uniqueness,
                  right, local, unique_around, disagreement, image, ring, allowed,  # noqa: E127
                  scale, table, odds, features):  # noqa: E127
    """Fill rows start..stop of `odds`; and of `features` (K, H, W, F), if asked."""
    count, _, width = maps.shape
    reach = (fine.shape[1] - width) // 2
    weight = np.empty(width, np.float32)
    known, every = np.empty(width, np.float32), np.empty(width, np.float32)
    agreeing = np.empty((count, width), np.float32)
    for y in range(start, stop):
        _count_votes(y, reach, maps, fine, inside, image, ring, allowed, weight, known, every,
                     agreeing)
        for k in range(count):
            for x in range(width):
                z = maps[k, y, x]
                # What is as good as the first needs no judgement of its own.
                if k > 0 and features.shape[0] == 0 and abs(z - maps[0, y, x]) <= ALIKE:
                    odds[k, y, x] = odds[0, y, x]
                    continue
                partner = int(np.floor(x - z / scale + np.float32(0.5)))
                is_seen = 0 <= partner < width
                seen = right[y, partner] if is_seen else NONE
                g, p, f, c = given[y, x], plane[y, x], fine[y + reach, x + reach], coarse[y, x]
                residual = min(abs(p - z), np.float32(1))
                q = quality[y, x]
                is_given = g > NONE
                is_near = is_given and abs(g - z) <= 1
                f_near = max(np.float32(0), np.float32(1) - abs(f - z))
                vote = (agreeing[k, x] + np.float32(0.5)) / (
                    known[x] + np.float32(1)) - np.float32(0.5)
                is_hole = np.float32(0) if is_given else np.float32(1)
                values = (
                    np.float32(1),
                    vote,
                    known[x] / max(every[x], np.float32(1e-6)) - np.float32(0.5),
                    q * (np.float32(1) - residual),
                    q if residual >= 1 else np.float32(0),
                    residual,
                    np.float32(1) if is_given and not is_near else np.float32(0),
                    local[y, x] if is_near else np.float32(0),
                    local[y, x] if is_given and not is_near else np.float32(0),
                    f_near,
                    np.float32(1) if c > NONE and abs(c - z) > 1 else np.float32(0),
                    uniqueness[y, x] if f_near > 0 else np.float32(0),
                    _bend(maps[k], y, x),
                    _step(maps[k], y, x),
                    np.float32(1) if seen > NONE and seen < z - 1 else np.float32(0),
                    np.float32(0) if is_seen else np.float32(1),
                    is_hole,
                    is_hole * vote,
                    is_hole * q * (np.float32(1) - residual),
                    unique_around[y, x],
                    disagreement[y, x])
                total = np.float32(0)
                for i in range(len(values)):
                    total += values[i] * table[i]
                odds[k, y, x] = total
                if features.shape[0] > 0:
                    for i in range(len(values)):
                        features[k, y, x, i] = values[i]


@njit(cache=True, nogil=True, inline='always')
def _bend(z, y, x):
    """Mean of both second differences at a pixel, each at most 1 px."""
    height, width = z.shape
    up, down = z[max(y - 1, 0), x], z[min(y + 1, height - 1), x]
    left, right = z[y, max(x - 1, 0)], z[y, min(x + 1, width - 1)]
    twice, one = np.float32(2) * z[y, x], np.float32(1)
    return np.float32(0.5) * (min(abs(up + down - twice), one)
                              + min(abs(left + right - twice), one))


@njit(cache=True, nogil=True, inline='always')
def _step(z, y, x):
    """1 where the map steps between a pixel and those two away, else 0."""
    height, width = z.shape
    here = z[y, x]
    most = max(max(abs(z[max(y - 2, 0), x] - here), abs(z[min(y + 2, height - 1), x] - here)),
               max(abs(z[y, max(x - 2, 0)] - here), abs(z[y, min(x + 2, width - 1)] - here)))
    return np.float32(1) if most > STEP else np.float32(0)


# The order of these sums does not matter, so that they fill vector registers.
@njit(cache=True, nogil=True, fastmath={'contract', 'arcp'}, error_model='numpy')
def _count_votes(y, reach, maps, fine, inside, image, ring, allowed, weight, known, every,
                 agreeing):
    """Weigh the neighbours on a ring by colour, and sum who matched and who agrees."""
    count, _, width = maps.shape
    known[:] = 0
    every[:] = 0
    agreeing[:] = 0
    difference = np.empty(width, np.int16)
    for i in range(ring.shape[0]):
        v, u = y + reach + ring[i, 0], reach + ring[i, 1]
        there, is_inside = fine[v, u:u + width], inside[v, u:u + width]
        difference[:] = 0
        for c in range(image.shape[0]):
            a = image[c, y + reach, reach:reach + width]
            b = image[c, v, u:u + width]
            for x in range(width):
                change = np.int16(np.int16(a[x]) - np.int16(b[x]))
                difference[x] = max(difference[x], max(change, np.int16(-change)))
        for x in range(width):
            d = np.float32(difference[x]) * np.float32(1 / COLOR_SCALE)
            w = is_inside[x] / (np.float32(1) + d * d)
            every[x] += w
            w = w if there[x] > NONE else np.float32(0)
            known[x] += w
            weight[x] = w
        limit = allowed[i]
        for k in range(count):
            z, sums = maps[k, y], agreeing[k]
            for x in range(width):
                sums[x] += weight[x] if abs(there[x] - z[x]) <= limit else np.float32(0)

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

from stereo_refine_ros.refinement.tuning import ALIKE, COLOR_SCALE

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
def judge_kernel(start, stop, maps, given, plane, fine, inside, coarse, uniqueness, right, local,
                 unique_around, disagreement, image, ring, allowed, scale, tables, odds):
    """Fill rows start..stop of `odds` (T, K, H, W) by each of T tables of coefficients."""
    count, height, width = maps.shape
    planes, quality, behind, slant, misfit = plane
    reach = (fine.shape[1] - width) // 2
    weight = np.empty(width, np.float32)
    known, every = np.empty(width, np.float32), np.empty(width, np.float32)
    agreeing = np.empty((count, width), np.float32)
    beside, seen = np.empty(width + 2, np.float32), np.empty(width, np.float32)
    partner = np.empty(width, np.int32)
    hole, border = np.empty(width, np.float32), np.empty(width, np.float32)
    for y in range(start, stop):
        _count_votes(y, reach, maps, fine, inside, image, ring, allowed, weight, known, every,
                     agreeing)
        _find_holes(given[y], hole, border)
        matched = fine[y + reach, reach:reach + width]
        for k in range(count):
            here = maps[k, y]
            above, below = maps[k, max(y - 1, 0)], maps[k, min(y + 1, height - 1)]
            beside[1:width + 1] = here
            beside[0], beside[width + 1] = here[0], here[width - 1]
            for t in range(tables.shape[0]):
                table, total = tables[t], odds[t, k, y]
                _by_votes(agreeing[k], known, every, hole, border, table, total)
                _by_planes(here, planes[y], quality[y], hole, border, table, total)
                _by_what_is_beside(here, behind[y], hole, border, table, total)
                _by_the_map(here, given[y], local[y], table, total)
                _by_matches(here, matched, coarse[y], uniqueness[y], table, total)
                _by_surroundings(unique_around[y], disagreement[y], slant[y], misfit[y], table,
                                 total)
                _by_bend(here, above, below, beside, table, total)
                _by_right_view(here, right[y], np.float32(scale), partner, seen, table, total)
                if k > 0:  # what is as good as the first needs no judgement of its own
                    _as_the_first(here, maps[0, y], odds[t, 0, y], total)


@njit(cache=True, nogil=True)
def _find_holes(given, hole, border):
    """Mark holes, and those of them that have a given pixel on one side only, or on none."""
    width = given.shape[0]
    first, last = width, -1
    for x in range(width):
        hole[x] = np.float32(0) if given[x] > NONE else np.float32(1)
        if given[x] > NONE:
            first, last = min(first, x), x
    for x in range(width):
        border[x] = np.float32(1) if x < first or x > last else np.float32(0)


# A loop over few arrays and without jumps fills vector registers; hence one for every kind of
# evidence, each of which adds its part. `table` is in the order of likelihood.FEATURES.
@njit(cache=True, nogil=True, error_model='numpy')
def _by_votes(agreeing, known, every, hole, border, table, total):
    half, one = np.float32(0.5), np.float32(1)
    for x in range(total.shape[0]):
        vote = (agreeing[x] + half) / (known[x] + one) - half
        total[x] = (table[0] + table[1] * vote
                    + table[2] * (known[x] / max(every[x], np.float32(1e-6)) - half)
                    + table[14] * hole[x] + table[15] * (hole[x] * vote) + table[18] * border[x])


@njit(cache=True, nogil=True)
def _by_planes(here, plane, quality, hole, border, table, total):
    nothing, one = np.float32(0), np.float32(1)
    for x in range(total.shape[0]):
        residual = min(abs(plane[x] - here[x]), one)
        near = quality[x] * (one - residual)
        total[x] += (table[3] * near + table[4] * (quality[x] if residual >= one else nothing)
                     + table[16] * (hole[x] * near) + table[19] * (border[x] * near))


@njit(cache=True, nogil=True)
def _by_what_is_beside(here, behind, hole, border, table, total):
    nothing, one = np.float32(0), np.float32(1)
    for x in range(total.shape[0]):
        near = max(nothing, one - abs(behind[x] - here[x]))
        total[x] += table[17] * (hole[x] * near) + table[20] * (border[x] * near)


@njit(cache=True, nogil=True)
def _by_the_map(here, given, local, table, total):
    nothing = np.float32(0)
    for x in range(total.shape[0]):
        is_near = abs(given[x] - here[x]) <= np.float32(1)
        smooth = table[6] * local[x]
        far = table[5] + table[7] * local[x]
        part = smooth if is_near else far
        total[x] += part if given[x] > NONE else nothing


@njit(cache=True, nogil=True)
def _by_matches(here, fine, coarse, uniqueness, table, total):
    nothing, one = np.float32(0), np.float32(1)
    for x in range(total.shape[0]):
        near = max(nothing, one - abs(fine[x] - here[x]))
        is_off = coarse[x] > NONE and abs(coarse[x] - here[x]) > one
        total[x] += (table[8] * near + table[9] * (one if is_off else nothing)
                     + table[10] * (uniqueness[x] if near > nothing else nothing))


@njit(cache=True, nogil=True)
def _by_surroundings(unique_around, disagreement, slant, misfit, table, total):
    for x in range(total.shape[0]):
        total[x] += (table[21] * unique_around[x] + table[22] * disagreement[x]
                     + table[23] * slant[x] + table[24] * misfit[x])


@njit(cache=True, nogil=True)
def _by_bend(here, above, below, beside, table, total):
    """Mean of both second differences of the map, each at most 1 px."""
    half, one, two = np.float32(0.5), np.float32(1), np.float32(2)
    for x in range(total.shape[0]):
        down = min(abs(above[x] + below[x] - two * here[x]), one)
        across = min(abs(beside[x] + beside[x + 2] - two * here[x]), one)
        total[x] += table[11] * (half * (down + across))


@njit(cache=True, nogil=True)
def _by_right_view(here, right, scale, partner, seen, table, total):
    """Whether the right view sees the pixel, and something behind what is said to be there."""
    width = total.shape[0]
    first, last = np.int32(0), np.int32(width - 1)
    for x in range(width):
        partner[x] = np.int32(np.floor(np.float32(x) - here[x] / scale + np.float32(0.5)))
    for x in range(width):
        seen[x] = right[np.uint32(min(max(partner[x], first), last))]
    for x in range(width):
        is_seen = partner[x] >= first and partner[x] <= last
        is_behind = seen[x] > NONE and seen[x] < here[x] - np.float32(1)
        part = table[12] if is_behind else np.float32(0)
        total[x] += part if is_seen else table[13]


@njit(cache=True, nogil=True)
def _as_the_first(here, first, first_odds, odds):
    for x in range(here.shape[0]):
        odds[x] = first_odds[x] if abs(here[x] - first[x]) <= np.float32(ALIKE) else odds[x]


# The order of these sums does not matter, so that they fill vector registers.
@njit(cache=True, nogil=True, fastmath={'contract', 'arcp'}, error_model='numpy')
def _count_votes(y, reach, maps, fine, inside, image, ring, allowed, weight, known, every,
                 agreeing):
    """Weigh the neighbours on a ring by colour, and sum who matched and who agrees."""
    count, _, width = maps.shape
    known[:] = 0
    every[:] = 0
    agreeing[:] = 0
    difference = np.empty(width, np.uint8)
    for i in range(ring.shape[0]):
        v, u = y + reach + ring[i, 0], reach + ring[i, 1]
        there, is_inside = fine[v, u:u + width], inside[v, u:u + width]
        difference[:] = 0
        for c in range(image.shape[0]):
            a = image[c, y + reach, reach:reach + width]
            b = image[c, v, u:u + width]
            for x in range(width):
                change = np.uint8(max(a[x], b[x]) - min(a[x], b[x]))
                difference[x] = max(difference[x], change)
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

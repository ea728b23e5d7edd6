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

"""A RANSAC plane d(x, y) = a x + b y + c for every segment (Hamzah et al. 2017, section 2.4)."""

from __future__ import annotations

from dataclasses import dataclass

from numba import njit
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.graph.segment_graph import PixelLists
from stereo_refine_ros.params import PlaneParams
from stereo_refine_ros.refinement.tuning import (
    FRONTO_PARALLEL, MAX_SLOPE_X, MAX_SLOPE_Y, REFITS, RIDGE, SCORED_POINTS)
from stereo_refine_ros.threads import run_bands
from stereo_refine_ros.types import FloatMap


@dataclass(frozen=True, eq=False)
class PlaneFits:
    """
    Planes of all segments before merging, with the moments of their inliers.

    Attributes
    ----------
    planes : float64 ndarray of shape (N, 5), NaN where nothing was fitted
        Columns a, b, c, and the least and the largest disparity among the inliers.
    inlier_ratio : float32 ndarray of shape (N,)
    data_count : int32 ndarray of shape (N,)
        Pixels of the segment with fit data.
    moments : float64 ndarray of shape (N, 10)
        Sums over the inliers of 1, x, y, d, xx, xy, yy, xd, yd, dd.

    """

    planes: NDArray[np.float64]
    inlier_ratio: NDArray[np.float32]
    data_count: NDArray[np.int32]
    moments: NDArray[np.float64]


def fit_planes(lists: PixelLists, data: FloatMap, params: PlaneParams,
               threads: int = 1) -> PlaneFits:
    """
    Fit a plane to the disparities of every segment: MSAC, then least-squares refits.

    Parameters
    ----------
    lists : PixelLists
        The pixels of every segment.
    data : float32 ndarray of shape (H, W)
        Sub-pixel disparities, NaN where there is no trustworthy one.
    params : PlaneParams
        Iterations, inlier threshold and seed.
    threads : int
        Segments are shared out among them.

    """
    count = lists.starts.size - 1
    fits = PlaneFits(np.full((count, 5), np.nan), np.zeros(count, np.float32),
                     np.zeros(count, np.int32), np.zeros((count, 10)))
    run_bands(_fit_kernel, count, threads, lists.pixels, lists.starts, data, params.iterations,
              np.float32(params.inlier_threshold), params.seed,
              fits.planes, fits.inlier_ratio, fits.data_count, fits.moments)
    return fits


@njit(cache=True, nogil=True)
def _fit_kernel(start, stop, pixels, starts, data, iterations, threshold, seed,
                planes, inlier_ratio, data_count, moments):
    for label in range(start, stop):
        points = _points_of(pixels[starts[label]:starts[label + 1]], data)
        found = points.shape[1]
        data_count[label] = found
        if found < 3:
            continue
        plane = _best_hypothesis(points, iterations, threshold, np.uint64(seed) + label)
        for _ in range(REFITS):
            sums = _inlier_moments(points, plane, threshold)
            if sums[0] < 3:
                break
            plane = plane_of_moments(sums)
        sums = _inlier_moments(points, plane, threshold)
        planes[label, 0], planes[label, 1], planes[label, 2] = plane
        planes[label, 3], planes[label, 4] = _inlier_range(points, plane, threshold)
        inlier_ratio[label] = sums[0] / found
        moments[label] = sums


@njit(cache=True, nogil=True)
def _points_of(members, data):
    """Return x, y and d of the pixels with data, float32 of shape (3, n)."""
    width = data.shape[1]
    points = np.empty((3, members.shape[0]), np.float32)
    found = 0
    y = members[0] // width
    for pixel in members:
        while pixel >= (y + 1) * width:  # in raster order, so that few rows need no division
            y += 1
        x = pixel - y * width
        if np.isfinite(data[y, x]):
            points[0, found], points[1, found], points[2, found] = x, y, data[y, x]
            found += 1
    return np.ascontiguousarray(points[:, :found])


@njit(cache=True, nogil=True)
def _next_random(state):
    """Step of splitmix64: a good stream from any seed, the same on every thread."""
    state = np.uint64(state + np.uint64(0x9E3779B97F4A7C15))
    z = np.uint64((state ^ (state >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9))
    z = np.uint64((z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB))
    return state, np.uint64(z ^ (z >> np.uint64(31)))


@njit(cache=True, nogil=True)
def _draw(state, count):
    """Next state of the stream and an index below `count`, from the upper bits."""
    state, bits = _next_random(state)
    return state, np.int64((bits >> np.uint64(33)) * np.uint64(count) >> np.uint64(31))


@njit(cache=True, nogil=True)
def _sample(points):
    """Return x, y and d of one point out of every n, at most SCORED_POINTS in all."""
    total = points.shape[1]
    step = -(-total // SCORED_POINTS)
    sample = np.empty((3, -(-total // step)), np.float32)
    for i in range(sample.shape[1]):
        # Always the first of n would be one column of the image where n is a segment's width;
        # multiples of the golden ratio are spread evenly.
        which = int(i * 0.6180339887498949 % 1.0 * step)
        sample[:, i] = points[:, min(i * step + which, total - 1)]
    return sample[0], sample[1], sample[2]


@njit(cache=True, nogil=True)
def _best_hypothesis(points, iterations, threshold, seed):
    """Plane of least MSAC score, (a, b, c), among hypotheses drawn from a sample."""
    xs, ys, ds = _sample(points)
    count = xs.shape[0]
    state = np.uint64(seed) * np.uint64(0x2545F4914F6CDD1D)
    best = (0.0, 0.0, 0.0)
    least = np.float32(np.inf)
    for trial in range(iterations):
        state, i = _draw(state, count)
        a, b = np.float32(0), np.float32(0)
        if trial >= FRONTO_PARALLEL:
            state, j = _draw(state, count)
            state, k = _draw(state, count)
            ux, uy, ud = xs[j] - xs[i], ys[j] - ys[i], ds[j] - ds[i]
            vx, vy, vd = xs[k] - xs[i], ys[k] - ys[i], ds[k] - ds[i]
            area = ux * vy - uy * vx
            if area == 0:
                continue
            a = np.float32((ud * vy - uy * vd) / area)
            b = np.float32((ux * vd - ud * vx) / area)
            if abs(a) > MAX_SLOPE_X or abs(b) > MAX_SLOPE_Y:
                continue
        c = np.float32(ds[i] - a * xs[i] - b * ys[i])
        score = _msac_score(xs, ys, ds, a, b, c, threshold * threshold)
        if score < least:
            least = score
            best = (np.float64(a), np.float64(b), np.float64(c))
    return best


# The order of this sum is free, so that it fills vector registers; no NaN comes here.
@njit(cache=True, nogil=True, fastmath={'reassoc', 'contract'})
def _msac_score(xs, ys, ds, a, b, c, limit):
    """Sum of squared residuals, each at most `limit`."""
    score = np.float32(0)
    for i in range(xs.shape[0]):
        residual = ds[i] - (a * xs[i] + b * ys[i] + c)
        score += min(residual * residual, limit)
    return score


# The order of these sums is free as well.
@njit(cache=True, nogil=True, fastmath={'reassoc'})
def _inlier_moments(points, plane, threshold):
    """Sum over the inliers 1, x, y, d, xx, xy, yy, xd, yd, dd."""
    a, b, c = plane
    n, sx, sy, sd, sxx, sxy, syy, sxd, syd, sdd = 0., 0., 0., 0., 0., 0., 0., 0., 0., 0.
    for i in range(points.shape[1]):
        x, y, d = np.float64(points[0, i]), np.float64(points[1, i]), np.float64(points[2, i])
        inside = 1.0 if abs(d - (a * x + b * y + c)) <= threshold else 0.0
        n += inside
        sx += inside * x
        sy += inside * y
        sd += inside * d
        sxx += inside * x * x
        sxy += inside * x * y
        syy += inside * y * y
        sxd += inside * x * d
        syd += inside * y * d
        sdd += inside * d * d
    return np.array([n, sx, sy, sd, sxx, sxy, syy, sxd, syd, sdd])


@njit(cache=True, nogil=True)
def _inlier_range(points, plane, threshold):
    """Least and largest disparity within the threshold of a plane."""
    a, b, c = plane
    low, high = np.inf, -np.inf
    for i in range(points.shape[1]):
        x, y, d = np.float64(points[0, i]), np.float64(points[1, i]), np.float64(points[2, i])
        if abs(d - (a * x + b * y + c)) <= threshold:
            low = min(low, d)
            high = max(high, d)
    return low, high


@njit(cache=True, nogil=True)
def plane_of_moments(sums):
    """Least-squares plane (a, b, c) of the points behind the sums, its slope held by a ridge."""
    n = sums[0]
    x, y, d = sums[1] / n, sums[2] / n, sums[3] / n
    xx = sums[4] / n - x * x + RIDGE / n
    yy = sums[6] / n - y * y + RIDGE / n
    xy = sums[5] / n - x * y
    xd = sums[7] / n - x * d
    yd = sums[8] / n - y * d
    area = xx * yy - xy * xy
    a = min(max((xd * yy - yd * xy) / area, -MAX_SLOPE_X), MAX_SLOPE_X)
    b = min(max((yd * xx - xd * xy) / area, -MAX_SLOPE_Y), MAX_SLOPE_Y)
    return a, b, d - a * x - b * y


@njit(cache=True, nogil=True)
def residual_variance(sums, plane):
    """Mean squared residual of the points behind the sums from a plane."""
    n = sums[0]
    a, b, c = plane
    total = (sums[9] + a * a * sums[4] + b * b * sums[6] + c * c * n
             - 2 * a * sums[7] - 2 * b * sums[8] - 2 * c * sums[3]
             + 2 * a * b * sums[5] + 2 * a * c * sums[1] + 2 * b * c * sums[2])
    return max(total / n, 0.0)

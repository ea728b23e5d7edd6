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

"""Votes against whole maps swept one by one; holes, ranges, threads."""

import numpy as np
import pytest

from stereo_refine_ros.graph.pixel_graph import edge_weights
from stereo_refine_ros.graph.support import sweep
from stereo_refine_ros.refinement import spreading
from stereo_refine_ros.refinement.spreading import spread_disparities


def supports(values, weights, min_disparity, count, monkeypatch):
    """Sweep the votes of one disparity after the other, as whole maps."""
    monkeypatch.setattr('stereo_refine_ros.graph.support.FADE', spreading._FADE)
    maps = []
    for d in range(min_disparity, min_disparity + count):
        votes = np.maximum(spreading._REACH - np.abs(d - np.rint(values)), 0)
        votes = np.where(np.isfinite(values), votes, 0).astype(np.float32)
        maps.append(sweep(votes, weights, spreading._SIGMA))
    return np.stack(maps, axis=2)


def problem(shape, low, high, seed=0):
    rng = np.random.default_rng(seed)
    values = rng.uniform(low, high, shape).astype(np.float32)
    values[rng.random(shape) < 0.3] = np.nan
    return values, edge_weights(rng.integers(0, 60, shape, dtype=np.uint8))


@pytest.mark.parametrize('shape, min_disparity, count', [
    ((7, 9), 0, 12), ((5, 8), -6, 9), ((4, 6), 3, 40), ((3, 5), 0, 1), ((1, 7), 0, 8),
    ((6, 1), 0, 5), ((1, 1), 2, 4)])
def test_the_disparity_of_most_support_wins(shape, min_disparity, count, monkeypatch):
    values, weights = problem(shape, min_disparity - 2, min_disparity + count + 1)
    expected = supports(values, weights, min_disparity, count, monkeypatch)
    spread = spread_disparities(values, weights, min_disparity, count)
    assert spread.dtype == np.float32
    index = (spread - min_disparity).astype(int)
    assert index.min() >= 0 and index.max() < count
    chosen = np.take_along_axis(expected, index[..., None], 2)[..., 0]
    # The least that rounding of sums in another order may turn round.
    np.testing.assert_allclose(chosen, expected.max(axis=2), rtol=1e-4, atol=1e-4)


def test_holes_take_the_disparity_of_their_own_colour():
    grey = np.zeros((9, 12), np.uint8)
    grey[:, 6:] = 200
    values = np.where(grey == 0, np.float32(3), np.float32(20))
    holes = values.copy()
    holes[2:7, 3:9] = np.nan
    np.testing.assert_array_equal(
        spread_disparities(holes, edge_weights(grey), 0, 24), values)


def test_without_a_vote_the_smallest_disparity_is_left():
    holes = np.full((3, 4), np.nan, np.float32)
    weights = edge_weights(np.zeros((3, 4), np.uint8))
    assert np.all(spread_disparities(holes, weights, 5, 40) == 5)


@pytest.mark.compiled
@pytest.mark.parametrize('count', [7, 33, 100])
@pytest.mark.parametrize('threads', [2, 3])
def test_threads_do_not_change_a_bit(threads, count):
    values, weights = problem((21, 33), 0, count)
    np.testing.assert_array_equal(spread_disparities(values, weights, 0, count, threads),
                                  spread_disparities(values, weights, 0, count))

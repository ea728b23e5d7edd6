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

"""Means over neighbours of like colour."""

import math

import numpy as np
import pytest

from stereo_refine_ros.graph.support import mean_of_alike
from stereo_refine_ros.graph.tuning import FADE

SIGMA = 0.1


def slow_mean(values, counts, weights):
    """Sum over rows, then columns, each step fading by FADE and its colour change."""
    height, width = values.shape

    def step(weight):
        return FADE * math.exp(-float(weight) / (255 * SIGMA))

    def along_row(y, x, v):
        return math.prod(step(weights[y, u, 0]) for u in range(min(x, v), max(x, v)))

    def along_column(x, y, v):
        return math.prod(step(weights[u, x, 1]) for u in range(min(y, v), max(y, v)))

    out = np.zeros(values.shape)
    for y, x in np.ndindex(values.shape):
        total, number = float(values[y, x]), float(counts[y, x])
        for v in range(height):
            for u in range(width):
                part = along_column(x, y, v) * along_row(v, x, u)
                total += part * values[v, u]
                number += part * counts[v, u]
        out[y, x] = total / number if number else 0
    return out


@pytest.mark.parametrize('threads', [1, 3])
def test_means_are_those_of_plain_python(threads):
    rng = np.random.default_rng(0)
    counts = (rng.random((5, 7)) < 0.6).astype(np.float32)
    values = rng.uniform(-3, 3, (5, 7)).astype(np.float32) * counts
    weights = rng.integers(0, 60, (5, 7, 2), np.uint8)
    np.testing.assert_allclose(mean_of_alike(values, counts, weights, SIGMA, threads),
                               slow_mean(values, counts, weights), rtol=1e-4, atol=1e-5)


def test_nobody_counts_and_the_mean_is_zero():
    nothing = np.zeros((2, 3), np.float32)
    mean = mean_of_alike(nothing, nothing, np.zeros((2, 3, 2), np.uint8), SIGMA)
    np.testing.assert_array_equal(mean, nothing)


def test_across_a_strong_edge_nobody_is_heard():
    values, ones = np.float32([[1, 1, 9, 9]]), np.ones((1, 4), np.float32)
    weights = np.zeros((1, 4, 2), np.uint8)
    weights[0, 1, 0] = 255
    mean = mean_of_alike(values, ones, weights, 0.02)
    np.testing.assert_allclose(mean, values, atol=1e-6)

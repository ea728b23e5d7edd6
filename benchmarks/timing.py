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

"""Times of one method after another, round by round, so that a drift of the machine hits all."""

from __future__ import annotations

from collections.abc import Callable, Mapping
import statistics
import time
from typing import Any


def time_rounds(methods: Mapping[str, Callable[[], Any]], rounds: int, budget_s: float
                ) -> tuple[dict[str, list[float]], dict[str, Any]]:
    """
    Call every method once a round; return their times in ms and their last results.

    The first call of each warms caches and compiles kernels and does not count. A method that
    has used up `budget_s` seconds sits out the later rounds, but has at least three.
    """
    results = {name: method() for name, method in methods.items()}
    times: dict[str, list[float]] = {name: [] for name in methods}
    for _ in range(rounds):
        for name, method in methods.items():
            if len(times[name]) >= 3 and sum(times[name]) > budget_s * 1e3:
                continue
            start = time.perf_counter()
            results[name] = method()
            times[name].append((time.perf_counter() - start) * 1e3)
    return times, results


def quartiles(values: list[float]) -> tuple[float, float, float]:
    """Return the lower quartile, the median and the upper quartile."""
    if len(values) < 2:
        return values[0], values[0], values[0]
    low, middle, high = statistics.quantiles(values, n=4, method='inclusive')
    return low, middle, high

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

"""Counters that account for every pair exactly once, safe to use from several threads."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field
import threading
import time

_RATE_WINDOW = 31


@dataclass(frozen=True)
class Counts:
    """
    One consistent view of the counters.

    `received` equals published + superseded + the sum of `refused` + `in_flight`.
    """

    received: int = 0
    published: int = 0
    superseded: int = 0
    in_flight: int = 0
    failures: int = 0
    degraded: int = 0
    refused: dict[str, int] = field(default_factory=dict)


class FrameCounters:
    """
    Account for pairs: every one received is published, superseded or refused with a reason.

    `failures` counts exceptions of the processing, `degraded` the frames that were published
    unrefined because of them.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Start at zero."""
        self._lock = threading.Lock()
        self._clock = clock
        self._counts: Counter[str] = Counter()
        self._refused: Counter[str] = Counter()
        self._published_at: deque[float] = deque(maxlen=_RATE_WINDOW)

    def received(self) -> None:
        """Count a pair that came in."""
        self._count('received')

    def superseded(self) -> None:
        """Count a pair that a newer one replaced before work on it began."""
        self._count('superseded')

    def failed(self) -> None:
        """Count an exception of the processing."""
        self._count('failures')

    def degraded(self) -> None:
        """Count a frame published unrefined."""
        self._count('degraded')

    def refused(self, reason: str) -> None:
        """Count a pair that could not be used."""
        with self._lock:
            self._refused[reason] += 1

    def published(self) -> None:
        """Count a pair whose disparity went out."""
        with self._lock:
            self._counts['published'] += 1
            self._published_at.append(self._clock())

    def fps(self) -> float:
        """Frames published per second, over the last 30 intervals; 0 after two idle seconds."""
        with self._lock:
            times = list(self._published_at)
        if len(times) < 2 or self._clock() - times[-1] > 2.0 or times[-1] == times[0]:
            return 0.0
        return (len(times) - 1) / (times[-1] - times[0])

    def counts(self) -> Counts:
        """Return a consistent copy."""
        with self._lock:
            values, refused = dict(self._counts), dict(self._refused)
        done = (values.get('published', 0) + values.get('superseded', 0)
                + sum(refused.values()))
        return Counts(refused=refused, in_flight=values.get('received', 0) - done, **values)

    def _count(self, name: str) -> None:
        with self._lock:
            self._counts[name] += 1


class Throttle:
    """Let one message per key through in a period."""

    def __init__(self, period_s: float, clock: Callable[[], float] = time.monotonic) -> None:
        """Start with every key allowed."""
        self._period_s = period_s
        self._clock = clock
        self._lock = threading.Lock()
        self._last: dict[str, float] = {}

    def allows(self, key: str) -> bool:
        """Return True once per period and key."""
        now = self._clock()
        with self._lock:
            if now - self._last.get(key, -self._period_s) < self._period_s:
                return False
            self._last[key] = now
            return True

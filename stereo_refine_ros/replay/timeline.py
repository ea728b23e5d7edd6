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

"""When the messages of a bag are due: at a speed, with pauses, one by one."""

from __future__ import annotations

from collections.abc import Callable
import time

_NS = 1_000_000_000
_FASTER = 1.1
_SLOWEST, _FASTEST = 0.01, 1000.0


class Timeline:
    """
    The bag's time against the wall's.

    Parameters
    ----------
    speed : float
        1 plays as recorded, 2 twice as fast.
    is_paused : bool
        Whether to start paused.
    now : callable
        Returns seconds of a clock that never jumps.

    """

    def __init__(self, speed: float, is_paused: bool = False,
                 now: Callable[[], float] = time.monotonic) -> None:
        """Stand at the time 0 of the bag."""
        self.speed = speed
        self.is_paused = is_paused
        self._now = now
        self._from_ns, self._since = 0, now()
        self._steps = 0

    @property
    def position_ns(self) -> int:
        """Return the bag's time now, in nanoseconds."""
        if self.is_paused:
            return self._from_ns
        return self._from_ns + round((self._now() - self._since) * self.speed * _NS)

    def begin(self, stamp_ns: int) -> None:
        """Go to a time of the bag, back or ahead."""
        self._from_ns, self._since = stamp_ns, self._now()

    def wait_s(self, stamp_ns: int) -> float:
        """Return the seconds until a message recorded at `stamp_ns` is due; inf while paused."""
        if not self.is_paused:
            return max(0.0, (stamp_ns - self.position_ns) / _NS / self.speed)
        return 0.0 if self._steps else float('inf')

    def passed(self, stamp_ns: int) -> None:
        """Note that a message went out: while paused, that is one step done."""
        if self.is_paused:
            self._steps -= 1
            self.begin(stamp_ns)

    def toggle(self) -> None:
        """Pause, or go on."""
        self.begin(self.position_ns)
        self.is_paused, self._steps = not self.is_paused, 0

    def step(self) -> None:
        """Let the next message out, while paused."""
        self._steps += self.is_paused

    def change_speed(self, is_faster: bool) -> None:
        """Play a tenth faster, or slower, from here on."""
        self.begin(self.position_ns)
        factor = _FASTER if is_faster else 1 / _FASTER
        self.speed = min(_FASTEST, max(_SLOWEST, self.speed * factor))

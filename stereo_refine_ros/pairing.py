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

"""
Pairing of messages by stamp, in plain Python: exactly, or approximately within a slop.

A set is complete when every required topic has a message of one stamp. An optional topic is
waited for a moment while it is in step: it is alive, and the last set had its message, or would
have had it before the next set came. Queues are bounded, what found no partner is counted by
topic, and clocks that jump back (a looped bag) empty the queue of the topic that jumped.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

ALIVE_S = 2.0  # an optional topic that was silent for longer is not waited for
GRACE_S = 0.25  # longest wait for an optional message
MOST_BYTES = 1 << 28  # of one topic that are kept for their age


@dataclass(frozen=True, eq=False)
class MessageSet:
    """Messages of one instant by topic; `stamp_ns` is that of the first required topic."""

    stamp_ns: int
    messages: dict[str, Any]


@dataclass(frozen=True, eq=False)
class Queued:
    """A message, when it came, and the bytes of its data."""

    message: Any
    arrival: float

    @property
    def size(self) -> int:
        """Bytes of data; 0 for messages that hold little."""
        return len(getattr(self.message, 'data', b''))


@dataclass(frozen=True)
class Limits:
    """How much of a topic is kept: a number of messages, and all that are younger."""

    count: int = 10
    age_s: float = 0.0


@dataclass
class TopicState:
    """Queue and history of one topic: by stamp, in order of arrival."""

    queue: dict[int, Queued] = field(default_factory=dict)
    received: int = 0
    unmatched: int = 0
    last_arrival: float | None = None
    last_stamp_ns: int | None = None
    alive_until: float = 0.0
    in_step: bool = True

    def put(self, stamp_ns: int, message: Any, limits: Limits, now: float) -> None:
        """Queue a message; drop what a jump back in time or the limit makes useless."""
        jumped_back = self.last_stamp_ns is not None and stamp_ns < self.last_stamp_ns
        if jumped_back:
            self.drop([stamp for stamp in self.queue if stamp > stamp_ns])
        self.drop([stamp_ns] if stamp_ns in self.queue else [])
        self.queue[stamp_ns] = Queued(message, now)
        self.drop(self._surplus(limits, now))
        self.received += 1
        self.last_arrival, self.last_stamp_ns = now, stamp_ns
        self.alive_until = now + ALIVE_S

    def _surplus(self, limits: Limits, now: float) -> list[int]:
        """Name the oldest messages beyond the count that are too old or too much."""
        if len(self.queue) <= limits.count:
            return []
        size = sum(item.size for item in self.queue.values())
        surplus = []
        for stamp, item in list(self.queue.items())[:-limits.count]:
            if now - item.arrival < limits.age_s and size <= MOST_BYTES:
                break
            surplus.append(stamp)
            size -= item.size
        return surplus

    def drop(self, stamps: Iterable[int]) -> None:
        """Remove messages that found no partner."""
        for stamp in stamps:
            del self.queue[stamp]
            self.unmatched += 1


class Pairing:
    """
    Collect messages into sets of one instant.

    Parameters
    ----------
    required, optional : iterable of str
        Topic names; the first required one gives a set its stamp.
    slop_ns : int
        Largest difference of stamps within a set; 0 pairs equal stamps only.
    queue_size : int
        Messages kept per topic.
    keep_s : float
        Seconds for which more of them are kept, within `MOST_BYTES`.

    """

    def __init__(self, required: Iterable[str], optional: Iterable[str] = (),
                 slop_ns: int = 0, queue_size: int = 10, keep_s: float = 0.0) -> None:
        """Start with empty queues."""
        self.required = tuple(required)
        self.optional = tuple(optional)
        self.topics = {name: TopicState() for name in self.required + self.optional}
        self._slop_ns = slop_ns
        self._limits = Limits(queue_size, keep_s)
        self._last_stamp_ns: int | None = None
        self._held: MessageSet | None = None
        self._held_until = 0.0

    @property
    def unmatched(self) -> int:
        """Instants for which some required topic delivered and another did not."""
        return max(self.topics[name].unmatched for name in self.required)

    @property
    def holds(self) -> bool:
        """Whether a complete set waits for an optional message."""
        return self._held is not None

    def expect(self, topic: str, now: float) -> None:
        """Wait for an optional topic whose publisher has just appeared."""
        self.topics[topic].alive_until = now + ALIVE_S
        self.topics[topic].in_step = True

    def add(self, topic: str, stamp_ns: int, message: Any, now: float) -> list[MessageSet]:
        """Take one message; return the sets that are complete now, oldest first."""
        self.topics[topic].put(stamp_ns, message, self._limits, now)
        if topic in self.optional:
            self.topics[topic].in_step |= self._is_of_last_set(stamp_ns)
            return self._complete_held(now)
        chosen = self._choose(topic, stamp_ns)
        if chosen is None:
            return self.release(now)
        ready = self._take_held()
        self._held = self._take(chosen)
        self._held_until = now + GRACE_S
        return ready + self._complete_held(now)

    def release(self, now: float) -> list[MessageSet]:
        """Return the held set if it has waited long enough."""
        return self._take_held() if now >= self._held_until else []

    def _is_of_last_set(self, stamp_ns: int) -> bool:
        last = self._last_stamp_ns
        return last is not None and abs(stamp_ns - last) <= self._slop_ns

    def _choose(self, topic: str, stamp_ns: int) -> dict[str, int] | None:
        """Find for each required topic the stamp nearest to the one that came."""
        chosen = {topic: stamp_ns}
        for name in self.required:
            nearest = self._nearest(name, stamp_ns)
            if nearest is None:
                return None
            chosen[name] = nearest
        spread = max(chosen.values()) - min(chosen.values())
        return chosen if spread <= self._slop_ns else None

    def _nearest(self, topic: str, stamp_ns: int) -> int | None:
        queue = self.topics[topic].queue
        if stamp_ns in queue:
            return stamp_ns
        near = [stamp for stamp in queue if abs(stamp - stamp_ns) <= self._slop_ns]
        return min(near, key=lambda stamp: abs(stamp - stamp_ns)) if near else None

    def _take(self, chosen: dict[str, int]) -> MessageSet:
        """Remove a set from the queues, and with it all that is older."""
        messages = {}
        for name, stamp in chosen.items():
            state = self.topics[name]
            messages[name] = state.queue.pop(stamp).message
            state.drop([old for old in state.queue if old < stamp])
        return MessageSet(chosen[self.required[0]], messages)

    def _complete_held(self, now: float) -> list[MessageSet]:
        """Give the held set its optional messages; return it when none is missing."""
        held = self._held
        if held is None:
            return []
        missing = [name for name in self.optional if name not in held.messages]
        for name in missing:
            state = self.topics[name]
            stamp = self._nearest(name, held.stamp_ns)
            if stamp is not None:
                held.messages[name] = state.queue.pop(stamp).message
                state.drop([old for old in state.queue if old < stamp])
        waiting = any(name not in held.messages and self.topics[name].in_step
                      and now < self.topics[name].alive_until for name in missing)
        return self.release(now) if waiting else self._take_held()

    def _take_held(self) -> list[MessageSet]:
        held, self._held = self._held, None
        if held is None:
            return []
        self._last_stamp_ns = held.stamp_ns
        for name in self.optional:
            self.topics[name].in_step = name in held.messages
        return [held]

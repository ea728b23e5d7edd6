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

"""Why pairs are not complete: a topic that is missing, slow, lossy or late, or other stamps."""

from __future__ import annotations

from collections.abc import Mapping

from stereo_refine_ros.pairing import Pairing

_SLOW_SHARE = 0.8  # of the fastest topic's rate: below it a topic is slow or loses messages
_FEWEST = 4  # messages a second from which rates can be compared
_NEAR_SHARE = 0.45  # of the time between frames: stamps that near are of one instant


def explain_unmatched(pairing: Pairing, rates: Mapping[str, int]) -> str:
    """
    Say why pairs are not complete, and what to do.

    Parameters
    ----------
    pairing : Pairing
        With what still waits for its partner.
    rates : mapping of str to int
        Messages of the last second by required topic.

    """
    stamps = {name: pairing.topics[name].last_stamp_ns for name in pairing.required}
    missing = [name for name, stamp in stamps.items() if stamp is None]
    if missing:
        return f'{", ".join(missing)} never came: check its name, remapping and QoS'
    slowest, fastest = min(rates, key=rates.__getitem__), max(rates, key=rates.__getitem__)
    if rates[fastest] >= _FEWEST and rates[slowest] < _SLOW_SHARE * rates[fastest]:
        return (f'{slowest} delivers {rates[slowest]} of {rates[fastest]} a second: its camera '
                'is slow, or messages are lost on the way; large images need the Fast DDS '
                'profile in config/ (or mono8)')
    known = {name: stamp for name, stamp in stamps.items() if stamp is not None}
    last = min(known, key=known.__getitem__)
    lag_ns = max(known.values()) - known[last]
    period_ns = 1e9 / max(rates[fastest], 1)
    gap_ns = _nearest_gap_ns(pairing)
    if gap_ns and gap_ns < _NEAR_SHARE * period_ns:
        return (f'stamps of one instant differ by {gap_ns / 1e6:.1f} ms: set sync.approximate '
                f'to true and sync.slop to {1.5 * gap_ns / 1e9:.4f} or more')
    if lag_ns > 2 * period_ns:
        return (f'{last} lags by {lag_ns / 1e6:.0f} ms: its source is too slow or its clock is '
                'another one; lower its rate or resolution, or raise sync.queue_size')
    return ('messages are lost on the way ('
            + ', '.join(f'{name} {rate}' for name, rate in rates.items())
            + ' a second, few of one instant): large images need the Fast DDS profile in '
            'config/, or smaller images')


def _nearest_gap_ns(pairing: Pairing) -> int:
    """Return how near waiting messages of the first two required topics come; 0 if none wait."""
    first, second = (list(pairing.topics[name].queue) for name in pairing.required[:2])
    return min((abs(a - b) for a in first for b in second), default=0)

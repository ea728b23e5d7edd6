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

"""What the tests of a running node share: its calibration, parameters, pairs and counters."""

import itertools

from harness import stereo_messages, textured_pair
from stereo_refine_ros.params import load_preset
from stereo_refine_ros.types import StereoGeometry

GEOMETRY = StereoGeometry(200.0, 0.1, 80.0, 48.0, 77.5, 200.0)
PARAMS = load_preset('live', {'matching.num_disparities': 32, 'matching.min_disparity': 1})
stamps = itertools.count(1_000_000_007, 33_000_000)


def good_pair():
    return stereo_messages(*textured_pair(), next(stamps), cx_right=77.5)


def values_of(message):
    return {item.key: float(item.value) for item in message.status[0].values}


def diagnosis(client):
    found = client.received['/diagnostics']
    client.until(lambda: found, 10.0, 'a first diagnosis')
    return found[-1].status[0]


def settled_health(client, condition):
    """Wait until the counters satisfy a condition; return them."""
    client.until(lambda: client.received['/diagnostics'] and condition(client.health()), 10.0,
                 lambda: f'counters, they are {client.health()}')
    return client.health()

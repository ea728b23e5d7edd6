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

"""A node in its own process, a client of it, and the core's answer to the same pair."""

from diagnostic_msgs.msg import DiagnosticArray
from harness import Client, reliable_inputs, running_node, stereo_messages, textured_pair
from live_node import PARAMS
import pytest
from stereo_msgs.msg import DisparityImage
from stereo_refine_ros.pipeline import StereoRefiner


@pytest.fixture(scope='module')
def node():
    with running_node('-p', 'matching.num_disparities:=32',
                      '-p', 'matching.min_disparity:=1', *reliable_inputs()) as process:
        yield process


@pytest.fixture(scope='module')
def client(node):
    client = Client()
    for topic, kind in (('disparity', DisparityImage), ('metrics', DiagnosticArray),
                        ('/diagnostics', DiagnosticArray)):
        client.subscribe(topic, kind)
    client.connect(stereo_messages(*textured_pair(), 1))
    yield client
    client.close()


@pytest.fixture(scope='module')
def core():
    return StereoRefiner(PARAMS).process(*textured_pair())

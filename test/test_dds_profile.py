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

"""The profile is set where nobody chose another, where it is read, and where it fits."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from stereo_refine_ros import dds_profile
from stereo_refine_ros.dds_profile import profile_variables, VARIABLES
from stereo_refine_ros.params import preset_path

CONFIG = preset_path('live').parent


@pytest.fixture(autouse=True)
def roomy(monkeypatch):
    monkeypatch.setattr(
        dds_profile.shutil, 'disk_usage', lambda path: SimpleNamespace(free=1 << 30))


@pytest.mark.parametrize('environment', [
    {}, {'RMW_IMPLEMENTATION': 'rmw_fastrtps_cpp'}, {'ROS_DOMAIN_ID': '5'}])
def test_profile_is_set_where_nobody_chose(environment):
    assert profile_variables(CONFIG, environment) == dict.fromkeys(
        VARIABLES, str(CONFIG / 'fastdds_shm.xml'))


@pytest.mark.parametrize('environment', [
    {VARIABLES[0]: '/mine.xml'}, {VARIABLES[1]: '/mine.xml'},
    {'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4'}, {'RMW_IMPLEMENTATION': 'rmw_cyclonedds_cpp'}])
def test_what_somebody_chose_stays(environment):
    assert profile_variables(CONFIG, environment) == {}


def test_no_room_or_no_profile_sets_nothing(monkeypatch, tmp_path):
    assert profile_variables(tmp_path, {}) == {}
    monkeypatch.setattr(
        dds_profile.shutil, 'disk_usage', lambda path: SimpleNamespace(free=64 << 20))
    assert profile_variables(CONFIG, {}) == {}
    monkeypatch.setattr(dds_profile, 'SHARED_MEMORY', Path('/nowhere'))
    assert profile_variables(CONFIG, {}) == {}

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

"""Processes on one host get DDS domains of their own."""

import os
import subprocess
import sys

from stereo_refine_ros import dds_domain

CLAIM = 'from stereo_refine_ros.dds_domain import claim_domain; print(claim_domain())'


def test_no_two_claims_are_the_same_while_they_last(tmp_path, monkeypatch):
    monkeypatch.setattr(dds_domain, '_held', held := [])
    monkeypatch.setattr(dds_domain, 'DOMAINS', range(1, 4))
    monkeypatch.setattr('tempfile.tempdir', str(tmp_path))
    claims = [int(dds_domain.claim_domain()) for _ in range(3)]
    assert sorted(claims) == [1, 2, 3]
    assert int(dds_domain.claim_domain()) in claims  # all are taken
    os.close(held.pop(0))
    assert int(dds_domain.claim_domain()) == claims[0]
    for lock in held:
        os.close(lock)


def test_another_process_takes_another_and_leaves_it_when_it_ends():
    taken = dds_domain.claim_domain()
    others = [subprocess.run([sys.executable, '-c', CLAIM], capture_output=True, text=True,
                             check=True).stdout.strip() for _ in range(2)]
    assert taken not in others and all(1 <= int(other) <= 101 for other in others)


def test_a_domain_that_was_chosen_stays(monkeypatch):
    monkeypatch.setattr(dds_domain, 'claim_domain', lambda: '7')
    monkeypatch.setenv('ROS_DOMAIN_ID', '42')
    dds_domain.use_own_domain()
    assert os.environ['ROS_DOMAIN_ID'] == '42'
    monkeypatch.delenv('ROS_DOMAIN_ID')
    dds_domain.use_own_domain()
    assert os.environ['ROS_DOMAIN_ID'] == '7'

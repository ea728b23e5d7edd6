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

"""Ten seconds of `make soak`, and a handful of `reliability/signals.py`."""

from pathlib import Path
import re
import subprocess
import sys

import pytest

pytestmark = pytest.mark.ros
RELIABILITY = Path(__file__).resolve().parents[2] / 'reliability'


def run(script, *options):
    done = subprocess.run([sys.executable, str(RELIABILITY / script), *options],
                          capture_output=True, text=True, timeout=180)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_every_set_is_accounted_for_in_a_short_soak():
    text = run('soak.py', '--seconds', '15', '--fault-rate', '0.3', '--seed', '4')
    counts = {name: int(count) for name, count in re.findall(r'^\| ([a-z ]+) \| (\d+) \|$',
                                                             text, re.MULTILINE)}
    assert counts['sent whole'] > 20
    assert counts['of these malformed'] > 2 and counts['sent without the right image'] > 0
    assert counts['received whole by the node'] > counts['sent whole'] / 2
    assert counts['received whole by the node'] == (
        counts['published'] + counts['superseded by a newer one']
        + counts['refused with a reason'])
    assert counts['unmatched'] == (counts['sent without the right image']
                                   + counts['of which a part was lost on the way'])
    assert counts['exceptions in the processing'] == 0


def test_signals_to_a_busy_node():
    text = run('signals.py', '--times', '1', '--stages', 'busy', '--seed', '3')
    assert re.findall(r'\| busy \| ([\w ]+) \| 1 \|.*\| 0 \|', text) == [
        'SIGINT', 'SIGINT twice', 'SIGTERM']

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

"""The accuracy tables, and the check that refinement makes nothing worse."""

import importlib.util
from pathlib import Path
import sys

import pytest
from scene_folder import write_scene

PATH = Path(__file__).resolve().parents[2] / 'benchmarks' / 'accuracy.py'


@pytest.fixture(scope='module')
def accuracy():
    spec = importlib.util.spec_from_file_location('accuracy_benchmark', PATH)
    module = importlib.util.module_from_spec(spec)
    sys.path.insert(0, str(PATH.parent))  # as when it is run as a script
    sys.modules[spec.name] = module  # where dataclasses look for their module
    spec.loader.exec_module(module)
    return module


def test_tables_of_two_scenes(accuracy, tmp_path, capsys):
    write_scene(tmp_path, 'cones')
    write_scene(tmp_path, 'other', seed=1)
    assert accuracy.main(['--data', str(tmp_path), '--matching', 'sgbm', '--preset', 'live',
                          '--seeds', '0,1']) == 0
    lines = capsys.readouterr().out.splitlines()
    headers = [line for line in lines if line.startswith('| ') and 'sgbm' not in line]
    v2_header, other_header, average_header = (line for line in headers if '---' not in line)
    assert v2_header.count('|') == 1 + 1 + 12 + 1
    assert other_header == '| bad-1.0 % nonocc / all | other | average |'
    assert average_header.endswith('| MSE | SSIM |')
    v2_cells = next(line for line in lines if line.startswith('| sgbm, refined')).split(' | ')
    # Only Cones is there, without a disc mask: two of twelve columns, no average.
    assert [cell.strip(' |') == '-' for cell in v2_cells[1:]] == [True] * 9 + [False] * 2 + [
        True, True]
    assert any(line.endswith(' of 20 figures') for line in lines)


def test_violations_are_what_got_worse(accuracy):
    def entry(bad, mse):
        return accuracy.Entry('cones', 'sgbm', {}, {
            'preliminary': {'bad-1.0 all': 5.0, 'mse': 40.0},
            'after': {'bad-1.0 all': bad, 'mse': mse}})

    assert entry(5.04, 40.0).violations() == []
    assert entry(5.06, 39.0).violations() == ['cones sgbm: bad-1.0 all 5.00 -> 5.06']
    assert entry(4.0, 40.5).violations() == ['cones sgbm: mse 40.00 -> 40.50']


def test_check_ends_with_one_only_when_asked(accuracy, tmp_path, monkeypatch):
    write_scene(tmp_path, 'one')
    monkeypatch.setattr(accuracy.Entry, 'violations', lambda self: ['one sgbm: mse 1 -> 2'])
    arguments = ['--data', str(tmp_path), '--matching', 'sgbm', '--preset', 'live']
    assert accuracy.main(arguments) == 0
    assert accuracy.main([*arguments, '--check', '--external']) == 1

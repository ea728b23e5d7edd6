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

"""ROS's own linters, where they are installed: apt's beside a sourced ROS, else PyPI's wheels."""

from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ('stereo_refine_ros', 'test', 'launch', 'benchmarks', 'scripts', 'demo', 'reliability')
SOURCES = [str(ROOT / name) for name in (*FOLDERS, 'setup.py') if (ROOT / name).exists()]


@pytest.mark.filterwarnings('ignore::DeprecationWarning', 'ignore::PendingDeprecationWarning')
@pytest.mark.parametrize('linter, paths', [
    ('flake8', SOURCES), ('pep257', SOURCES),
    ('copyright', [*SOURCES, str(ROOT / 'CONTRIBUTING.md'), str(ROOT / 'LICENSE')])])
def test_sources_pass(linter, paths, capsys):
    name = f'ament_{linter}.main'
    pytest.importorskip(name)
    code = import_module(name).main(paths)
    printed = capsys.readouterr()
    assert code == 0, printed.out + printed.err

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

"""docs/parameters.md and config/live.yaml say what the parameter definitions say."""

import importlib.util
from pathlib import Path
import re

from stereo_refine_ros.params import load_preset, Params, PRESETS, read_preset_file, SPECS
import yaml

ROOT = Path(__file__).resolve().parents[1]


def _script():
    path = ROOT / 'scripts' / 'parameter_table.py'
    spec = importlib.util.spec_from_file_location('parameter_table', path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_table_of_parameters_is_current():
    text = (ROOT / 'docs' / 'parameters.md').read_text(encoding='utf-8')
    assert _script().BEGIN in text
    assert text == _script().page_with_table(text), 'run `make tables`'


def test_table_has_every_parameter_with_its_default_once():
    rows = [line.split(' | ') for line in _script().markdown_table().splitlines()[2:]]
    assert [row[0] for row in rows] == [f'| `{spec.name}`' for spec in SPECS]
    defaults = dict(zip((spec.name for spec in SPECS), (row[1] for row in rows), strict=True))
    assert defaults['output.min_confidence'] == '0.5'
    assert defaults['temporal.enabled'] == 'true'
    assert defaults['matching.method'] == 'scanline'


def test_live_yaml_is_current():
    text = (ROOT / 'config' / 'live.yaml').read_text(encoding='utf-8')
    assert text == _script().live_yaml(), 'run `make tables`'


def test_live_yaml_uncommented_is_the_default(tmp_path):
    text = (ROOT / 'config' / 'live.yaml').read_text(encoding='utf-8')
    values = re.sub(r'^    # ([a-z0-9_]+\.[a-z0-9_]+: )', r'    \1', text, flags=re.MULTILINE)
    path = tmp_path / 'all.yaml'
    path.write_text(values, encoding='utf-8')
    assert read_preset_file(path) == Params().as_dict()
    assert len(yaml.safe_load(values)['/**']['ros__parameters']) == len(SPECS)


def test_live_preset_is_the_default():
    assert load_preset('live') == Params()


def test_every_preset_has_its_file():
    assert {path.stem for path in (ROOT / 'config').glob('*.yaml')} >= set(PRESETS)
    for name in PRESETS:
        assert load_preset(name).preset == name

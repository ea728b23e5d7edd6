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

"""ROS parameter files: where the presets lie, and what a file sets."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml


def preset_path(name: str) -> Path:
    """Find `config/<name>.yaml` in the checkout, else in the installed share folder."""
    here = Path(__file__).resolve()
    candidates = [here.parents[1] / 'config' / f'{name}.yaml']
    candidates += [
        parent / 'share' / 'stereo_refine_ros' / 'config' / f'{name}.yaml'
        for parent in here.parents]
    for path in candidates:
        if path.is_file():
            return path
    raise FileNotFoundError(f'preset {name!r}: no {name}.yaml beside the package or in share/')


def read_section(path: Path, section: str = '/**') -> dict[str, Any]:
    """Read the values of one section of a ROS parameter file by dotted name, unchecked."""
    document = yaml.safe_load(path.read_text(encoding='utf-8'))
    flat: dict[str, Any] = {}
    _flatten(document[section]['ros__parameters'], '', flat)
    return flat


def _flatten(tree: Mapping[str, Any], prefix: str, out: dict[str, Any]) -> None:
    for key, value in tree.items():
        if isinstance(value, Mapping):
            _flatten(value, f'{prefix}{key}.', out)
        else:
            out[prefix + key] = value

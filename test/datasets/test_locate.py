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

"""Where scenes are looked for, in order."""

from pathlib import Path

import pytest

from stereo_refine_ros.datasets import locate
from stereo_refine_ros.datasets.locate import cache_dir, find_data


@pytest.fixture
def nothing(tmp_path, monkeypatch):
    """Return an empty workspace: no variable, no shared folder, an empty cache."""
    checkout = tmp_path / 'checkout'
    (checkout / 'stereo_refine_ros' / 'datasets').mkdir(parents=True)
    monkeypatch.setattr(
        locate, '__file__', str(checkout / 'stereo_refine_ros' / 'datasets' / 'locate.py'))
    work = tmp_path / 'elsewhere' / 'work'
    work.mkdir(parents=True)
    monkeypatch.chdir(work)
    monkeypatch.delenv('STEREO_REFINE_DATA', raising=False)
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path / 'cache'))
    return tmp_path


def _made(path: Path) -> Path:
    path.mkdir(parents=True)
    return path


def test_the_cache_is_the_last_resort(nothing):
    assert find_data() == nothing / 'cache' / 'stereo_refine_ros' / 'middlebury'


def test_each_place_goes_before_the_next(nothing, monkeypatch):
    beside_checkout = _made(nothing / 'shared' / 'middlebury')
    assert find_data() == beside_checkout
    beside_cwd = _made(nothing / 'elsewhere' / 'shared' / 'middlebury')
    assert find_data().resolve() == beside_cwd
    variable = _made(nothing / 'variable')
    monkeypatch.setenv('STEREO_REFINE_DATA', str(variable))
    assert find_data() == variable
    explicit = _made(nothing / 'explicit')
    assert find_data(explicit) == explicit


def test_a_folder_may_hold_the_scenes_as_middlebury(nothing):
    nested = _made(nothing / 'data' / 'middlebury')
    assert find_data(nothing / 'data') == nested


def test_a_folder_that_was_asked_for_must_exist(nothing, monkeypatch):
    with pytest.raises(FileNotFoundError, match='--data.*absent'):
        find_data(nothing / 'absent')
    monkeypatch.setenv('STEREO_REFINE_DATA', str(nothing / 'gone'))
    with pytest.raises(FileNotFoundError, match='STEREO_REFINE_DATA.*gone'):
        find_data()


def test_cache_without_xdg_is_in_the_home(monkeypatch, tmp_path):
    monkeypatch.delenv('XDG_CACHE_HOME', raising=False)
    monkeypatch.setenv('HOME', str(tmp_path))
    assert cache_dir() == tmp_path / '.cache' / 'stereo_refine_ros'

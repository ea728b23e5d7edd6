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

"""Values by dotted name: all of them or none, and what became of names that were."""

from pathlib import Path

import pytest

from stereo_refine_ros.params import (
    check_values, load_preset, Params, PRESETS, read_preset_file, REPLACED, SPEC_BY_NAME)


@pytest.mark.parametrize('name', list(REPLACED))
def test_names_of_former_versions_are_answered_with_what_to_do(name):
    assert name not in SPEC_BY_NAME
    with pytest.raises(ValueError, match=f'^{name}: no such parameter any more: .* '):
        load_preset('live', {name: 1})
    with pytest.raises(ValueError, match='any more'):
        Params().updated({name: 1})


def test_what_stands_in_their_place_is_there():
    named = {word.strip(';,') for text in REPLACED.values() for word in text.split()
             if '.' in word}
    assert named == {'processing.refine_pixels', 'planes.projection'}
    assert named <= set(SPEC_BY_NAME)


def test_a_file_with_a_former_name_says_so(tmp_path: Path):
    path = tmp_path / 'robot.yaml'
    path.write_text('/**:\n  ros__parameters:\n    processing:\n      min_rows: 240\n'
                    '    planes.spread: true\n', encoding='utf-8')
    with pytest.raises(ValueError) as refused:
        read_preset_file(path)
    assert str(refused.value).split('; planes')[0] == (
        'processing.min_rows: no such parameter any more: use processing.refine_pixels; rows are '
        'averaged no more')
    assert 'planes.spread: no such parameter any more: leave it out' in str(refused.value)


def test_everything_wrong_is_named_at_once_and_nothing_is_changed():
    params = load_preset('live')
    with pytest.raises(ValueError) as refused:
        params.updated({'matching.num_disparities': 0, 'filter.method': 'magic', 'radius': 3,
                        'planes.iterations': 5})
    for part in ('matching.num_disparities', 'filter.method', 'radius: no such parameter'):
        assert part in str(refused.value)
    assert params == load_preset('live')


@pytest.mark.parametrize('preset', PRESETS)
def test_presets_start_from_themselves_and_take_what_is_set(preset):
    params = load_preset(preset, {'planes.seed': 7})
    assert params.preset == preset and params.planes.seed == 7
    assert params.updated({}) == params
    assert Params().updated({'preset': preset, 'planes.seed': 7}) == params
    assert check_values(params.as_dict()) == params.as_dict()
    assert params.as_dict().keys() == SPEC_BY_NAME.keys()

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

"""The demo chooses a scene of a camera's size where there is one, and says what it found."""

import json
from pathlib import Path
import shutil

import numpy as np
import pytest

from demo.acts import CAMERA_SIZE_SCENES, choose_acts, ROW_OFFSET_PX, row_report  # noqa: I100
from stereo_refine_ros.datasets import render_scene
from stereo_refine_ros.evaluation.pictures import write_picture
from stereo_refine_ros.replay.options import build_parser, scene_source


def _store(folder: Path, seed: int):
    scene = render_scene(seed, 48, 64, 16, 1)
    folder.mkdir(parents=True)
    for side, view in (('left', scene.pair.left), ('right', scene.pair.right)):
        write_picture(folder / f'{side}.png', view)
    (folder / 'meta.json').write_text(json.dumps({'width': 64, 'height': 48, 'ndisp': 16}))
    return scene


def _played(act):
    options = build_parser().parse_args([*act.source])
    return next(iter(scene_source(options)()))


@pytest.fixture
def data(tmp_path):
    for place, name, seed in (('middlebury', 'Adirondack', 1), ('middlebury', 'cones', 2),
                              ('field/middlebury', 'Playroom', 3)):
        _store(tmp_path / place / name, seed)
    return tmp_path


@pytest.mark.parametrize('place', ['.', 'middlebury', 'field'])
def test_a_scene_of_a_cameras_size_comes_first(data, place):
    acts, note = choose_acts(None, str(data / place))
    assert [act.scene.name for act in acts] == ['Playroom', 'synthetic'] and note == ''
    for act in acts:
        np.testing.assert_array_equal(_played(act).pair.right, act.scene.pair.right)


def test_among_the_lab_scenes_there_is_one_too(data):
    shutil.rmtree(data / 'field')
    acts, _ = choose_acts(None, str(data))
    assert acts[0].scene.name == CAMERA_SIZE_SCENES[-1] == 'Adirondack'


def test_without_one_the_synthetic_scene_is_shown_alone(data):
    for name in ('field', 'middlebury/Adirondack'):
        shutil.rmtree(data / name)
    acts, note = choose_acts(None, str(data))
    assert [act.scene.name for act in acts] == ['synthetic']
    assert 'Motorcycle' in note and '--data' in note and note.endswith('the synthetic scene')
    assert choose_acts('synthetic', str(data))[1] == ''


def test_the_scene_asked_for_is_shown(data):
    acts, note = choose_acts('cones', str(data))
    assert [act.scene.name for act in acts] == ['cones', 'synthetic'] and note == ''
    np.testing.assert_array_equal(_played(acts[0]).pair.left, acts[0].scene.pair.left)


def test_report_of_the_row_offset(data):
    real, slipped = choose_acts('cones', str(data))[0]
    assert slipped.row_offset == ROW_OFFSET_PX == 1.5
    assert row_report(real, {'row_offset_px': 0.31}) == ''
    assert row_report(slipped, {'row_offset_px': 1.482}) == (
        'synthetic: the right image is 1.50 px lower than the left one: found 1.48 px, undone')
    assert row_report(slipped, {'row_offset_px': 0.0}).endswith(': not found')

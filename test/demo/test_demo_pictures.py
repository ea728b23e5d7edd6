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

"""The demo's pictures show what they say."""

import io

import cv2
import numpy as np
import pytest

from stereo_refine_ros.datasets import render_scene, Scene
from demo.pictures import write_pictures  # noqa: I100
from demo.table import format_value, LiveTable, summary_line

METRICS = {'bad_1_0_preliminary': 12.5, 'bad_1_0_refined': 3.25, 'total_ms': 31.0,
           'row_offset_px': 1.48, 'gain_ratio': 0.97, 'confidence_mean': 0.88}
ADVICE = 'WARN: one image has 40 % of the detail of the other [lens]'


@pytest.fixture(scope='module')
def scene():
    return render_scene(2)


def _write(folder, scene, preliminary, refined, labels, confidence=None):
    if confidence is None:
        confidence = np.ones_like(refined)
    files = write_pictures(folder, scene, preliminary, refined, labels, confidence, METRICS)
    return {path.stem: cv2.imread(str(path)) for path in files}


def test_every_picture_is_written_and_right(tmp_path, scene):
    preliminary = scene.truth.copy()
    preliminary[:, :40] = np.nan
    wrong = scene.truth + 5
    pictures = _write(tmp_path, scene, preliminary, wrong, scene.labels)
    assert set(pictures) == {'left', 'preliminary', 'refined', 'ground_truth', 'segments',
                             'error_preliminary', 'error_refined', 'confidence',
                             'side_by_side'}
    np.testing.assert_array_equal(pictures['left'], scene.pair.left)
    assert (pictures['preliminary'][:, :40] == 0).all()
    np.testing.assert_array_equal(
        pictures['preliminary'][:, 40:], pictures['ground_truth'][:, 40:])
    assert (pictures['error_preliminary'][:, :40] == 0).all()
    assert (pictures['error_preliminary'][:, 40:] > 240).all()
    assert (pictures['error_refined'] == [0, 0, 127]).all()


def test_near_is_lighter_than_far(tmp_path, scene):
    picture = _write(tmp_path, scene, scene.truth, scene.truth, scene.labels)['ground_truth']
    lightness = cv2.cvtColor(picture, cv2.COLOR_BGR2LAB)[..., 0].astype(float)
    assert np.corrcoef(lightness.ravel(), scene.truth.ravel())[0, 1] > 0.95


def test_confidence_is_dark_where_it_is_low(tmp_path, scene):
    confidence = np.ones_like(scene.truth)
    confidence[:, :40] = 0
    picture = _write(tmp_path, scene, scene.truth, scene.truth, scene.labels,
                     confidence)['confidence']
    assert picture[:, :40].max() < 5
    assert picture[:, 40:].min() > 180


def test_sheet_holds_nine_pictures_in_three_rows(tmp_path, scene):
    confidence = np.full_like(scene.truth, 0.5)
    pictures = _write(tmp_path, scene, scene.truth, scene.truth, scene.labels, confidence)
    sheet = pictures['side_by_side']
    assert sheet.shape == (3 * (330 + 34 + 8) + 8, 3 * (440 + 8) + 8, 3)
    middle = cv2.resize(pictures['confidence'], (440, 330), interpolation=cv2.INTER_NEAREST)
    np.testing.assert_array_equal(sheet[-338:-8, 456:896], middle)
    left = cv2.resize(scene.pair.left, (440, 330), interpolation=cv2.INTER_NEAREST)
    np.testing.assert_array_equal(sheet[42:372, 8:448], left)
    labels = sheet[8:42, 8:448]
    assert (labels < 100).any() and labels[0].min() == 255


def test_scene_without_truth_has_no_error_maps(tmp_path, scene):
    bare = Scene('bare', scene.pair)
    pictures = _write(tmp_path, bare, scene.truth, scene.truth, scene.labels)
    assert set(pictures) == {'left', 'preliminary', 'refined', 'segments', 'confidence',
                             'side_by_side'}
    nothing = np.full_like(scene.truth, np.nan)
    assert (_write(tmp_path, bare, nothing, nothing, scene.labels)['refined'] == 0).all()


def test_unwritable_folder_is_an_error(tmp_path, scene):
    with pytest.raises(OSError, match='left.png'):
        _write(tmp_path / 'absent', scene, scene.truth, scene.truth, scene.labels)


def test_line_of_metrics(capsys):
    assert format_value(None) == format_value(float('nan')) == '-'
    assert summary_line(METRICS).startswith('bad_1_0 12.5 -> 3.25, psnr - -> -')
    with LiveTable('title') as table:
        table.update(METRICS, 1)
        table.update(METRICS, 2)
    out = capsys.readouterr().out
    assert out.count('\n') == 1 and out.startswith('frame 1: bad_1_0 12.5 -> 3.25')
    assert out.endswith('row_offset_px 1.48, gain_ratio 0.97, noise_sigma -, '
                        'confidence_mean 0.88, published_ratio -\n')


def test_advice_stands_below_the_line(capsys):
    with LiveTable('title') as table:
        table.update(METRICS, 1, ADVICE)
    assert capsys.readouterr().out.splitlines()[1] == '  ' + ADVICE


def test_table_on_a_terminal_shows_both_columns(monkeypatch):
    from rich.console import Console
    from demo.table import _table
    console = Console(width=100, record=True, file=io.StringIO())
    console.print(_table('cones', METRICS, 7))
    console.print(_table('cones', METRICS, 8, ADVICE))
    text = console.export_text()
    assert 'cones, frame 7' in text
    row = next(line for line in text.splitlines() if 'wrong by more than 1 px' in line)
    assert '12.5' in row and '3.25' in row
    healthy, ill = text.split('cones, frame 8')
    assert 'OK: nothing to do' in healthy and ADVICE in ill and 'OK:' not in ill
    values = healthy.split('row_offset_px')[1].splitlines()[2]
    assert '1.48' in values and '0.97' in values and '0.88' in values

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

"""The command line, from arguments to files."""

from html.parser import HTMLParser
import io
import json
import re

from bag_writer import pair_messages, write_messages
import pytest
from scene_folder import small_scene, write_scene

from stereo_refine_ros.evaluate import main
from stereo_refine_ros.evaluation.progress import Progress
from stereo_refine_ros.params import load_preset


class Reader(HTMLParser):
    """Collects tags, their attributes and the text of a page; fails on unbalanced tags."""

    def __init__(self):
        super().__init__()
        self.open, self.tags, self.text = [], [], ''

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in ('meta', 'img', 'br'):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


@pytest.fixture(scope='module')
def run(tmp_path_factory):
    """Evaluate two rendered scenes with two filters and two projections."""
    root = tmp_path_factory.mktemp('evaluate')
    write_scene(root / 'data', 'one')
    write_scene(root / 'data', 'two', seed=1)
    code = main(['--data', str(root / 'data'), '--matching', 'sgbm', '--filters',
                 'none,weighted_median', '--projection', 'full,guarded', '--repeat', '1',
                 '-p', 'segmentation.k=200', '--json', str(root / 'out' / 'rows.json'),
                 '--output', str(root / 'report')])
    assert code == 0
    return root


def test_json_has_a_row_for_every_stage(run):
    rows = json.loads((run / 'out' / 'rows.json').read_text())
    assert len(rows) == 2 * 2 * 2 * 3
    labels = [(row['scene'], row['filter'], row['projection'], row['stage']) for row in rows]
    assert len(set(labels)) == len(rows)
    assert labels[0] == ('one', 'none', 'full', 'preliminary')
    for row in rows:
        assert row['matching'] == 'sgbm'
        assert 0 <= row['bad_3_0'] <= row['bad_2_0'] <= row['bad_1_0'] <= row['bad_0_5'] <= 100
        assert row['disc'] is None
        assert row['ms']['matching'] > 0


def test_report_is_one_file_that_needs_no_network(run):
    assert [path.name for path in (run / 'report').iterdir()] == ['report.html']
    text = (run / 'report' / 'report.html').read_text(encoding='utf-8')
    reader = Reader()
    reader.feed(text)
    assert reader.open == []
    sources = [attrs['src'] for tag, attrs in reader.tags if tag == 'img']
    assert all(source.startswith('data:image/webp;base64,') for source in sources)
    # Eight pictures in the open row of a scene, six in each folded one.
    assert len(sources) == 2 * (8 + 3 * 6)
    assert not re.search(r'https?:|<script|<link|@import|url\(', text)
    assert ('meta', {'name': 'viewport', 'content': 'width=device-width, initial-scale=1'}
            ) in reader.tags


def test_report_shows_the_rows(run):
    rows = json.loads((run / 'out' / 'rows.json').read_text())
    reader = Reader()
    reader.feed((run / 'report' / 'report.html').read_text(encoding='utf-8'))
    assert len([tag for tag, _ in reader.tags if tag == 'table']) == 5
    assert 'one, full projection' in reader.text
    assert '--filters none,weighted_median --projection full,guarded' in reader.text
    for row in rows:
        if row['stage'] != 'preliminary':
            assert f'{row["mse"]:.1f}' in reader.text
            assert f'{row["ssim"]:.4f}' in reader.text


def test_report_shows_the_confidence_of_every_method(run):
    rows = json.loads((run / 'out' / 'rows.json').read_text())
    reader = Reader()
    reader.feed((run / 'report' / 'report.html').read_text(encoding='utf-8'))
    confidence = reader.text.split('Confidence of the refined maps, 1 px')[1]
    for row in rows:
        if row['stage'] == 'after':
            assert f'{row["confidence_area"]:.4f}' in confidence
            assert f'{row["calibration_error"]:.3f}' in confidence
    assert len([tag for tag, _ in reader.tags if tag == 'svg']) == 2 * 8
    assert confidence.count('right pixels over confidence') == 8


def test_table_is_printed(tmp_path, capsys):
    write_scene(tmp_path, 'one')
    assert main(['--data', str(tmp_path), '--scenes', 'ONE', '--repeat', '1']) == 0
    out, err = capsys.readouterr()
    lines = out.splitlines()
    assert lines[0].split()[:5] == ['scene', 'matching', 'stage', 'filter', 'projection']
    assert [line.split()[2] for line in lines[1:4]] == ['preliminary', 'before', 'after']
    assert 'MSE falls in' in lines[4]
    assert err.startswith(f'1/1 one {load_preset("live").matching.method}')


@pytest.mark.parametrize(('arguments', 'message'), [
    (['--matching', 'magic'], "matching.method: 'magic' is none of"),
    (['-p', 'filter.radius=0'], 'filter.radius: 0 is outside 1 to 50'),
    (['--scenes', 'nowhere'], "scene 'nowhere'"),
])
def test_a_mistake_is_one_line(tmp_path, capsys, arguments, message):
    write_scene(tmp_path, 'one')
    assert main(['--data', str(tmp_path), *arguments]) == 1
    error = capsys.readouterr().err.strip()
    assert error.startswith('evaluate: ')
    assert message in error
    assert '\n' not in error


def test_arguments_that_cannot_be_read(capsys):
    for arguments in (['-p', 'filter.radius'], ['--repeat', '0'], ['--preset', 'fast']):
        with pytest.raises(SystemExit):
            main(arguments)
    assert 'is not NAME=VALUE' in capsys.readouterr().err


def test_bag_to_csv_and_plot(tmp_path, capsys):
    scenes = [small_scene(seed) for seed in range(2)]
    views = [(scene.pair.left, scene.pair.right) for scene in scenes]
    write_messages(tmp_path / 'bag', 'sqlite3', pair_messages(views, scenes[0].geometry))
    code = main(['--bag', str(tmp_path / 'bag'), '-p', 'matching.num_disparities=16',
                 '--pictures', '2', '--output', str(tmp_path / 'out')])
    assert code == 0
    assert len((tmp_path / 'out' / 'metrics.csv').read_text().splitlines()) == 3
    assert (tmp_path / 'out' / 'metrics.svg').read_text().startswith('<svg')
    out = capsys.readouterr().out
    assert re.search(r'^valid_ratio_refined +[01]\.\d{4}$', out, re.MULTILINE)
    assert '2 pairs' in out and out.count('cameras: ') == 1
    assert [path.name for path in (tmp_path / 'out').glob('*.png')] == ['000000.png']


def test_missing_bag_is_one_line(tmp_path, capsys):
    assert main(['--bag', str(tmp_path / 'none')]) == 1
    assert capsys.readouterr().err.startswith('evaluate: bag: ')


def test_progress_in_a_terminal_redraws_one_line():
    class Terminal(io.StringIO):

        def isatty(self):
            return True

    stream = Terminal()
    with Progress(2, stream) as progress:
        progress.step('first')
        progress.step('second')
    lines = stream.getvalue().split('\r')
    assert lines[1].endswith(f'[{"#" * 15}{"." * 15}] 1/2 first')
    assert lines[2].endswith(f'[{"#" * 30}] 2/2 second\n')

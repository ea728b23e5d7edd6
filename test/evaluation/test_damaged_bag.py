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

"""`evaluate --bag` on what is damaged: the rest is measured, and the exit code says so."""

import csv

from bag_writer import NS, pair_messages, write_messages
import cv2
import pytest
from scene_folder import small_scene

from stereo_refine_ros.evaluate import main

OPTIONS = ('-p', 'matching.num_disparities=16')


@pytest.fixture(scope='module')
def scenes():
    return [small_scene(seed) for seed in (0, 0, 1)]


def _views(scenes):
    return [(scene.pair.left, scene.pair.right) for scene in scenes]


def _rows(folder):
    with (folder / 'metrics.csv').open() as stream:
        return list(csv.DictReader(stream))


def test_one_damaged_message_costs_its_pair_alone(tmp_path, scenes, capsys):
    write_messages(tmp_path / 'bag', 'mcap', pair_messages(_views(scenes), scenes[0].geometry),
                   damaged={1000 * NS + NS // 10})
    code = main(['--bag', str(tmp_path / 'bag'), '--output', str(tmp_path / 'out'), *OPTIONS])
    assert code == 3
    assert [float(row['time']) for row in _rows(tmp_path / 'out')] == pytest.approx([0, 0.2])
    out, err = capsys.readouterr()
    assert '2 pairs; wrote' in out
    assert '2 damaged messages left out' in err and '/left/image_rect' in err


def test_whole_bag_ends_with_0(tmp_path, scenes):
    write_messages(tmp_path / 'bag', 'mcap', pair_messages(_views(scenes), scenes[0].geometry))
    assert main(['--bag', str(tmp_path / 'bag'), '--output', str(tmp_path / 'out'), *OPTIONS]) == 0
    assert len(_rows(tmp_path / 'out')) == 3


def test_a_bag_that_breaks_off_keeps_its_rows(tmp_path, scenes, capsys, monkeypatch):
    write_messages(tmp_path / 'bag', 'mcap', pair_messages(_views(scenes), scenes[0].geometry))
    from rosbags.rosbag2 import Reader, ReaderError
    whole = Reader.messages

    def broken(self, *args, **kwargs):
        for number, item in enumerate(whole(self, *args, **kwargs)):
            if number == 5:
                raise ReaderError('chunk is damaged')
            yield item
    monkeypatch.setattr(Reader, 'messages', broken)
    code = main(['--bag', str(tmp_path / 'bag'), '--output', str(tmp_path / 'out'), *OPTIONS])
    assert code == 1
    assert len(_rows(tmp_path / 'out')) == 2
    err = capsys.readouterr().err
    assert 'chunk is damaged' in err and 'mcap recover' in err and 'Traceback' not in err


def test_two_patterns_as_a_sequence(tmp_path, scenes, capsys):
    for number, scene in enumerate(scenes):
        cv2.imwrite(str(tmp_path / f'a{number}.png'), scene.pair.left)
        cv2.imwrite(str(tmp_path / f'b{number}.png'), scene.pair.right)
    options = ['--output', str(tmp_path / 'out'), *OPTIONS]
    assert main(['--left', str(tmp_path / 'a*'), '--right', str(tmp_path / 'b*'), *options]) == 0
    assert len(_rows(tmp_path / 'out')) == 3
    assert main(['--left', str(tmp_path / 'a*'), *options]) == 1
    assert 'go together' in capsys.readouterr().err

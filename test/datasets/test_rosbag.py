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

"""Pairs are read from bags exactly as they were recorded."""

from bag_writer import image, NS, pair_messages, write_messages
import numpy as np
import pytest

from stereo_refine_ros.datasets import render_scene
from stereo_refine_ros.datasets.rosbag import iterate_pairs


@pytest.fixture(scope='module')
def scenes():
    return [render_scene(seed, 48, 64, 16, 2, doffs_px=3.0) for seed in range(3)]


def _views(scenes):
    return [(scene.pair.left, scene.pair.right) for scene in scenes]


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
def test_pairs_come_back_in_order(tmp_path, scenes, storage):
    path = tmp_path / 'bag'
    write_messages(path, storage, pair_messages(_views(scenes), scenes[0].geometry))
    pairs = list(iterate_pairs(path))
    assert [pair.stamp_ns for pair in pairs] == [1000 * NS + i * NS // 10 for i in range(3)]
    for found, scene in zip(pairs, scenes, strict=True):
        np.testing.assert_array_equal(found.pair.left, scene.pair.left)
        np.testing.assert_array_equal(found.pair.right, scene.pair.right)


def test_prefixed_topics_and_grey_images_and_a_storage_file(tmp_path, scenes):
    left, right = (view[..., 0] for view in _views(scenes)[0])
    path = tmp_path / 'bag'
    write_messages(
        path, 'mcap', pair_messages([(left, right)], scenes[0].geometry, prefix='/robot/cam/'))
    for where in (path, next(path.glob('*.mcap'))):
        pair, = iterate_pairs(where)
        np.testing.assert_array_equal(pair.pair.left, left)


def test_views_without_partner_are_left_out_and_slop_pairs_the_near(tmp_path, scenes):
    left, right = _views(scenes)[0]
    messages = [('/left/image_rect', 1, image(5 * NS, left)),
                ('/left/image_rect', 2, image(6 * NS, left)),
                ('/right/image_rect', 3, image(6 * NS, right)),
                ('/right/image_rect', 4, image(7 * NS + 2_000_000, right)),
                ('/left/image_rect', 5, image(7 * NS, left))]
    write_messages(tmp_path / 'bag', 'sqlite3', messages)
    assert [pair.stamp_ns for pair in iterate_pairs(tmp_path / 'bag')] == [6 * NS]
    near = list(iterate_pairs(tmp_path / 'bag', slop_s=0.005))
    assert [pair.stamp_ns for pair in near] == [6 * NS, 7 * NS]


def test_pairs_after_a_jump_back_in_time_as_in_the_node(tmp_path, scenes):
    """Two recordings in one bag: what waits from before the jump does not pair with after it."""
    left, right = _views(scenes)[0]
    messages = [('/left/image_rect', 1, image(9 * NS, left)),
                ('/left/image_rect', 2, image(6 * NS, left)),
                ('/right/image_rect', 3, image(9 * NS, right)),
                ('/right/image_rect', 4, image(6 * NS, right))]
    write_messages(tmp_path / 'bag', 'sqlite3', messages)
    assert [pair.stamp_ns for pair in iterate_pairs(tmp_path / 'bag')] == [6 * NS]


def test_missing_and_ambiguous_topics_are_named(tmp_path, scenes):
    views = _views(scenes)[:1]
    geometry = scenes[0].geometry
    two = [*pair_messages(views, geometry, prefix='/a/'),
           *pair_messages(views, geometry, prefix='/b/')]
    write_messages(tmp_path / 'bag', 'mcap', two)
    with pytest.raises(ValueError, match='2 topics called left/image_rect.*/a/left/image_rect'):
        next(iterate_pairs(tmp_path / 'bag'))
    with pytest.raises(ValueError, match='no topics called colour'):
        next(iterate_pairs(tmp_path / 'bag', 'colour'))
    assert len(list(iterate_pairs(
        tmp_path / 'bag', '/a/left/image_rect', '/a/right/image_rect'))) == 1
    with pytest.raises(FileNotFoundError, match='absent'):
        next(iterate_pairs(tmp_path / 'absent'))


def test_what_is_no_bag_is_named(tmp_path):
    (tmp_path / 'bag').mkdir()
    with pytest.raises(ValueError, match='bag: .*/bag: '):
        next(iterate_pairs(tmp_path / 'bag'))
    for name in ('bag.mcap', 'bag.db3', 'bag.txt'):
        path = tmp_path / name
        path.write_bytes(b'this is no bag')
        with pytest.raises(ValueError, match=name):
            next(iterate_pairs(path))


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
def test_bag_cut_short_is_named(tmp_path, scenes, storage):
    write_messages(
        tmp_path / 'bag', storage, pair_messages(_views(scenes), scenes[0].geometry))
    path = next(item for item in (tmp_path / 'bag').iterdir() if item.suffix != '.yaml')
    path.write_bytes(path.read_bytes()[:20000])
    with pytest.raises(ValueError, match='bag: '):
        list(iterate_pairs(tmp_path / 'bag'))

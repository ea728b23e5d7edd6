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

from bag_writer import compressed, image, NS, pair_messages, raw_camera_info, write_messages
import cv2
import numpy as np
import pytest
from real_scenes import real_scene_folder

from stereo_refine_ros.datasets import iterate_folder, render_scene
from stereo_refine_ros.datasets.calibration import read_euroc
from stereo_refine_ros.datasets.folder import list_pairs
from stereo_refine_ros.datasets.rosbag import BagOptions, iterate_pairs


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
    near = list(iterate_pairs(tmp_path / 'bag', BagOptions(slop_s=0.005)))
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
        next(iterate_pairs(tmp_path / 'bag', BagOptions('colour')))
    assert len(list(iterate_pairs(
        tmp_path / 'bag', BagOptions('/a/left/image_rect', '/a/right/image_rect')))) == 1
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
    advice = 'mcap recover .*mcap -o' if storage == 'mcap' else 'sqlite3 .*db3 .recover'
    for where in (tmp_path / 'bag', path):
        with pytest.raises(ValueError, match=f'bag: .*{advice}'):
            list(iterate_pairs(where))


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
def test_bag_without_metadata_is_told_how_it_can_be_read(tmp_path, scenes, storage):
    write_messages(
        tmp_path / 'bag', storage, pair_messages(_views(scenes), scenes[0].geometry))
    (tmp_path / 'bag' / 'metadata.yaml').unlink()
    with pytest.raises(ValueError, match='pass .*bag.(mcap|db3) itself.*ros2 bag reindex'):
        list(iterate_pairs(tmp_path / 'bag'))
    assert len(list(iterate_pairs(next((tmp_path / 'bag').iterdir())))) == 3


def test_bag_of_ros_1_is_told_how_to_convert_it(tmp_path):
    path = tmp_path / 'drive.bag'
    path.write_bytes(b'#ROSBAG V2.0\n' + bytes(5000))
    for where in (path, tmp_path):
        with pytest.raises(ValueError, match='ROS 1; convert it: rosbags-convert --src .*drive'):
            next(iterate_pairs(where))


@pytest.mark.parametrize('apart_ms, options', [
    (4, 'sync.slop=0.006'), (0.001, 'sync.slop=1.5e-06'), (40, 'sync.slop=0.06')])
def test_stamps_that_never_meet_are_told_apart(tmp_path, scenes, apart_ms, options):
    left, right = _views(scenes)[0]
    messages = [(topic, i, image(i * NS // 10 + shift, view)) for i in range(1, 4)
                for topic, view, shift in (('/left/image_rect', left, 0),
                                           ('/right/image_rect', right, round(apart_ms * 1e6)))]
    write_messages(tmp_path / 'bag', 'mcap', messages)
    with pytest.raises(ValueError, match='3 left and 3 right images.* ms apart') as error:
        list(iterate_pairs(tmp_path / 'bag'))
    assert f'-p sync.approximate=true -p {options}' in str(error.value)
    slop = float(options.partition('=')[2])
    assert len(list(iterate_pairs(tmp_path / 'bag', BagOptions(slop_s=slop)))) == 3


def test_damaged_messages_are_counted_and_left_out(tmp_path, scenes):
    views = _views(scenes)
    messages = [*pair_messages(views, scenes[0].geometry)]
    strange = image(1000 * NS, views[0][0])
    strange.encoding = 'rgb9'
    messages[1] = ('/left/image_rect', 1000 * NS, strange)
    write_messages(tmp_path / 'bag', 'mcap', messages, damaged={1000 * NS + NS // 10})
    damaged = []
    pairs = list(iterate_pairs(tmp_path / 'bag', on_damaged=damaged.append))
    assert [pair.stamp_ns for pair in pairs] == [1000 * NS + 2 * NS // 10]
    assert len(damaged) == 3  # two cut off, one pair with an encoding unknown
    assert sum('damaged message' in text for text in damaged) == 2
    assert sum("encoding 'rgb9'" in text and '/left/image_rect' in text for text in damaged) == 1
    with pytest.raises(ValueError, match='rgb9'):
        list(iterate_pairs(tmp_path / 'bag'))


@pytest.mark.parametrize('suffix, kind', [('.png', 'bgr8; png compressed bgr8'),
                                          ('.jpg', 'jpeg')])
def test_compressed_images_are_found_under_their_own_name(tmp_path, scenes, suffix, kind):
    messages = [
        (f'/cam/{side}/image_rect/compressed', index,
         compressed(index * NS, cv2.imencode(suffix, view)[1], kind))
        for index, views in enumerate(_views(scenes))
        for side, view in zip(('left', 'right'), views, strict=True)]
    write_messages(tmp_path / 'bag', 'mcap', messages)
    pairs = list(iterate_pairs(tmp_path / 'bag'))
    assert len(pairs) == 3
    for found, (left, right) in zip(pairs, _views(scenes), strict=True):
        for got, sent in ((found.pair.left, left), (found.pair.right, right)):
            error = np.abs(got.astype(int) - sent)
            assert error.max() == 0 if suffix == '.png' else error.mean() < 12
    with pytest.raises(ValueError, match='/cam/left/image_rect/compressed'):
        next(iterate_pairs(tmp_path / 'bag', BagOptions('front/image_rect')))


def test_images_of_16_bits_share_one_scale(tmp_path):
    ramp = np.linspace(400, 3600, 64 * 48).reshape(48, 64).astype(np.uint16)
    messages = [(f'/{side}/image_rect', index, image(index * NS, view, 'mono16'))
                for index in range(2)
                for side, view in (('left', ramp), ('right', ramp // 2))]
    write_messages(tmp_path / 'bag', 'mcap', messages)
    for pair in iterate_pairs(tmp_path / 'bag'):
        assert pair.pair.left.dtype == np.uint8
        slopes = [np.polyfit(deep.ravel(), view.ravel(), 1)[0] for deep, view in (
            (ramp, pair.pair.left), (ramp // 2, pair.pair.right))]
        assert slopes[0] == pytest.approx(slopes[1], rel=0.02)


def test_raw_bag_is_rectified_as_its_folder_is(tmp_path):
    folder = real_scene_folder('../sequences/euroc_raw_excerpt')
    models = read_euroc(*(folder / 'mav0' / camera / 'sensor.yaml' for camera in ('cam0', 'cam1')))
    messages = []
    for name, *files in list_pairs(folder)[:2]:
        stamp = int(name)
        for side, path, model in zip(('left', 'right'), files, models, strict=True):
            messages += [  # the camera_info behind its image, and not of its stamp
                (f'/{side}/image_raw', stamp, image(stamp, cv2.imread(str(path), 0))),
                (f'/{side}/camera_info', stamp + 1, raw_camera_info(0, model))]
    write_messages(tmp_path / 'bag', 'mcap', messages)
    found = list(iterate_pairs(tmp_path / 'bag', BagOptions(rectify=True)))
    expected = [scene for scene, _ in zip(iterate_folder(folder), range(2), strict=False)]
    for item, scene in zip(found, expected, strict=True):
        np.testing.assert_array_equal(item.pair.left, scene.pair.left)
        np.testing.assert_array_equal(item.pair.right, scene.pair.right)


def test_rectifying_without_calibration_is_refused_by_name(tmp_path, scenes):
    left, right = _views(scenes)[0]
    write_messages(tmp_path / 'bag', 'mcap', [
        ('/left/image_raw', 1, image(NS, left)), ('/right/image_raw', 2, image(NS, right))])
    with pytest.raises(ValueError, match='needs /left/camera_info and /right/camera_info'):
        next(iterate_pairs(tmp_path / 'bag', BagOptions(rectify=True)))
    assert len(list(iterate_pairs(tmp_path / 'bag'))) == 1

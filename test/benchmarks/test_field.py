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

"""The field benchmark: reading every kind of truth, its figures and its tables."""

from dataclasses import replace
import json
import math
from types import SimpleNamespace

from cases import field_cases, FIELD_SETS
import cv2
import field
import field_report
from field_rows import as_json, measure_row
from field_scenes import (
    FieldScene, fill_along_rows, read_field_scene, read_network, scene_folders)
import numpy as np
import pytest
from real_scenes import real_scene_folder
from stereo_refine_ros.types import DisparityMap

VIEW = np.full((2, 4, 3), 90, np.uint8)
NAN = np.nan


def write_scene(folder, truth, **meta):
    folder.mkdir(parents=True)
    for side in ('left', 'right'):
        cv2.imwrite(str(folder / f'{side}.png'), VIEW)
    cv2.imwrite(str(folder / 'disp_left.png'), truth)
    (folder / 'meta.json').write_text(json.dumps({'ndisp': 16, **meta}))
    return folder


def scene(truth, group='eth3d', **masks):
    truth = np.array(truth, np.float32)
    return FieldScene(group, 'a', VIEW, VIEW, truth, 16,
                      {'all': np.isfinite(truth), **masks})


def result(given, after, confidence=((),), ms=5.0):
    given, after = (DisparityMap(np.array(values, np.float32), 0, 16)
                    for values in (given, after))
    return SimpleNamespace(preliminary=given, disparity=after, total_ms=ms,
                           confidence=np.array(confidence, np.float32))


def test_16_bit_truth_is_read_at_its_scale(tmp_path):
    raw = np.array([[0, 256, 2560, 65535]] * 2, np.uint16)
    read = read_field_scene(write_scene(
        tmp_path / 'a', raw, disp_scale=256, invalid_value=0), 'kitti2012')
    np.testing.assert_array_equal(read.truth[0], np.float32([NAN, 1, 10, 65535 / 256]))
    assert (read.group, read.name, read.num_disparities) == ('kitti2012', 'a', 16)
    assert read.network is None
    assert list(read.masks) == ['all']
    assert read.left.shape == (2, 4, 3)


def test_8_bit_truth_in_three_channels_and_a_derived_mask(tmp_path):
    raw = np.repeat(np.array([[0, 3, 6, 30]] * 2, np.uint8)[..., None], 3, axis=2)
    folder = write_scene(tmp_path / 'a', raw, disp_scale=3, invalid_value=None)
    cv2.imwrite(str(folder / 'mask_nonocc_derived.png'),
                np.array([[0, 128, 255, 255]] * 2, np.uint8))
    read = read_field_scene(folder, 'middlebury')
    np.testing.assert_array_equal(read.truth[0], np.float32([NAN, 1, 2, 10]))
    assert read.masks['nonocc'][0].tolist() == [False, False, True, True]


def test_pfm_truth_is_read_from_the_bottom_up(tmp_path):
    folder = write_scene(tmp_path / 'a', np.zeros((2, 4), np.uint8), disp_scale=1)
    rows = np.array([[5, 6, 7, np.inf], [1, 2, 3, 4]], '<f4')  # the lower row first
    (folder / 'disp_left.pfm').write_bytes(b'Pf\n4 2\n-1.0\n' + rows.tobytes())
    np.testing.assert_array_equal(
        read_field_scene(folder, 'eth3d').truth, np.float32([[1, 2, 3, 4], [5, 6, 7, NAN]]))


def test_the_networks_map_is_read(tmp_path):
    cv2.imwrite(str(tmp_path / 'external_hitnet.png'), np.array([[0, 1, 641]], np.uint16))
    np.testing.assert_array_equal(read_network(tmp_path), np.float32([[NAN, 0, 10]]))


def test_scenes_are_found_in_order_and_missing_ones_are_said(tmp_path):
    for name in ('b', 'a'):
        write_scene(tmp_path / 'field' / 'eth3d' / name, np.ones((2, 4), np.uint8))
    write_scene(tmp_path / 'middlebury' / 'cones', np.ones((2, 4), np.uint8))
    assert [path.name for path in scene_folders(tmp_path, 'eth3d')] == ['a', 'b']
    assert [path.name for path in scene_folders(tmp_path, 'lab')] == ['cones']
    with pytest.raises(FileNotFoundError, match='--data names the folder'):
        scene_folders(tmp_path, 'kitti2012')


def test_speed_takes_the_scenes_of_a_cameras_width(tmp_path):
    for group in FIELD_SETS:
        for name, width in (('small', 599), ('wide', 600)):
            folder = write_scene(tmp_path / 'field' / group / name,
                                 np.full((2, width), 12, np.uint8), disp_scale=4)
            for side in ('left', 'right'):
                cv2.imwrite(str(folder / f'{side}.png'), np.zeros((2, width, 3), np.uint8))
    cases = list(field_cases(tmp_path))
    assert [(case.scene, case.size, case.threshold) for case in cases] == [
        ('wide', 'Middlebury, about 700x500', 1.0), ('wide', 'ETH3D, about 900x450', 1.0),
        ('wide', 'KITTI (3 px), about 1240x375', 3.0)]
    assert (cases[0].truth == 3).all()


def test_holes_take_the_farther_neighbour_of_their_row():
    values = np.float32([[NAN, 5, NAN, 3], [8, NAN, NAN, 9], [NAN] * 4])
    assert fill_along_rows(values).tolist() == [[5, 5, 3, 3], [8, 8, 8, 9], [0] * 4]


@pytest.mark.parametrize(('name', 'known', 'wrong'), [
    ('kitti2012/000000_10', 0.3509, 0.36), ('eth3d/delivery_area_3l', 0.8916, 0.03),
    ('middlebury/Motorcycle', 0.9791, 11.21)])
def test_real_truth_is_as_dense_as_its_data_set_says_and_the_network_near(
        name, known, wrong):
    folder = real_scene_folder(f'../field/{name}')
    read = read_field_scene(folder, folder.parent.name)
    assert np.isfinite(read.truth).mean() == pytest.approx(known, abs=1e-4)
    row = measure_row(read, 'hitnet', 'live', SimpleNamespace(
        preliminary=DisparityMap(read.network, 0, read.num_disparities),
        disparity=DisparityMap(read.network, 0, read.num_disparities),
        confidence=np.zeros((0, 0)), total_ms=0.0))
    assert row.bad('given') == pytest.approx(wrong, abs=0.01)


def test_row_counts_wrong_pixels_of_the_filled_maps():
    truth = [[10, 10, 10, NAN], [10, 10, 10, 10]]
    nonocc = np.array([[True, True, False, True], [False] * 4])
    row = measure_row(
        scene(truth, nonocc=nonocc), 'own', 'live',
        result([[10, NAN, 13, 99], [10, 12, 10, 10]],  # the hole becomes 10
               [[11, 11.5, 10, 99], [10, 14, 10, 10]],
               np.full((2, 4), 0.95)))
    bad = {key: row.figures[f'{key}_bad_{px}_{region}'] for key, px, region in (
        ('given', 1, 'all'), ('after', 1, 'nonocc'))}
    assert bad == {'given': pytest.approx(100 * 2 / 7), 'after': pytest.approx(50)}
    assert row.figures['given_bad_2_all'] == pytest.approx(100 / 7)  # 2 px off is not more
    assert row.figures['after_bad_3_all'] == pytest.approx(100 / 7)
    assert row.harm == pytest.approx(0)
    assert (row.figures['given_density'], row.figures['ms']) == (7 / 8, 5.0)
    assert row.figures['sure_share'] == 1.0
    assert row.figures['sure_wrong'] == pytest.approx(2 / 7)


def test_without_mask_or_confidence_there_is_no_figure():
    row = measure_row(scene([[10.0]]), 'own', 'live', result([[10]], [[10]]))
    assert math.isnan(row.figures['after_bad_1_nonocc'])
    assert math.isnan(row.figures['confidence_area'])
    assert as_json([row])[0]['confidence_area'] is None
    assert as_json([row])[0]['after_bad_1_all'] == 0.0


def test_kitti_counts_from_3_px():
    row = measure_row(scene([[10, 10]], 'kitti2012'), 'own', 'live',
                      result([[12, 14]], [[12, 12]]))
    assert (row.bad('given'), row.bad('after'), row.harm) == (50.0, 0.0, -50.0)


def rows_of_two_scenes():
    confident = np.full((1, 4), 0.9)
    good = measure_row(scene([[10] * 4]), 'own', 'live',
                       result([[10, 10, 12, 12]], [[10, 10, 10, 12]], confident, ms=4.0))
    bad = measure_row(scene([[10] * 4], 'kitti2012'), 'own', 'live',
                      result([[10] * 4], [[10, 10, 10, 15]], confident, ms=6.0))
    return [good, bad]


def test_tables_say_what_became_worse():
    rows = rows_of_two_scenes()
    assert field_report.worse_rows(rows) == rows[1:]
    lines = field_report.error_table(rows).splitlines()
    assert lines[2].split(' | ')[1:] == [
        'eth3d (1)', '1', '50.00', '25.00', '-', '-', '0', '-25.00 a', '4 |']
    assert lines[3].split(' | ')[1:] == [
        'kitti2012 (1)', '3', '0.00', '25.00', '-', '-', '1', '+25.00 a', '6 |']
    assert '| **0.00 -> 25.00** |' in field_report.scene_table(rows)
    assert '50.00 -> 25.00 | 25.00 -> 0.00 |' not in field_report.threshold_table(rows)
    assert '| 50.00 -> 25.00 | 0.00 -> 0.00 | 0.00 -> 0.00 |' in (
        field_report.threshold_table(rows))


def test_peers_are_not_counted_among_the_worse(capsys):
    ours, worse = rows_of_two_scenes()
    assert field_report.print_report([ours, replace(worse, preset='peer')]) == []
    assert 'Worse by more than 0.1 points: 0 of 1 maps' in capsys.readouterr().out
    assert field_report.print_report([ours, worse]) == [worse]
    assert '- kitti2012 a, own, live: 0.00 -> 25.00' in capsys.readouterr().out


def test_confidence_is_averaged_over_all_sets_but_the_lab():
    rows = rows_of_two_scenes()
    lines = field_report.confidence_table(rows).splitlines()
    # One of four wrong, all alike sure: area 1/4, best (1/4)/4, 0.75 kept of 0.9 promised.
    assert [line.split(' | ')[1] for line in lines[2:]] == [
        'eth3d (1)', 'kitti2012 (1)', 'field (2)']
    assert lines[4].split(' | ')[2:] == [
        '0.2500', '0.0625', '4.00', '1.000', '0.250', '0.150', '0.000 |']
    assert 'field (' not in field_report.confidence_table(rows[:1])


def test_unknown_names_are_refused(capsys):
    with pytest.raises(SystemExit):
        field.main(['--maps', 'own,elas'])
    assert 'elas is none of own, sgbm, bm, hitnet' in capsys.readouterr().err


@pytest.fixture
def small_set(tmp_path):
    """Write a slanted wall of random texture, 4 to 8 px, as the set eth3d; return the root."""
    rng = np.random.default_rng(1)
    texture = cv2.GaussianBlur(rng.integers(0, 256, (60, 200)).astype(np.float32), (0, 0), 1)
    column, row = np.meshgrid(np.arange(120, dtype=np.float32), np.arange(60, dtype=np.float32))
    truth = (4 + row / 15).astype(np.float32)
    folder = write_scene(tmp_path / 'field' / 'eth3d' / 'wall',
                         np.rint(truth * 256).astype(np.uint16), disp_scale=256, invalid_value=0)
    for side, shift in (('left', 0), ('right', truth)):
        cv2.imwrite(str(folder / f'{side}.png'), cv2.remap(
            texture, column + 40 + shift, row, cv2.INTER_LINEAR))
    cv2.imwrite(str(folder / 'external_hitnet.png'), np.rint(truth * 64 + 1).astype(np.uint16))
    return tmp_path


def test_benchmark_measures_every_map_and_preset(small_set, capsys):
    output = small_set / 'rows.json'
    code = field.main(['--data', str(small_set), '--sets', 'eth3d', '--maps', 'sgbm,hitnet',
                       '--presets', 'live', '--threads', '1', '--peers', '--json', str(output)])
    rows = json.loads(output.read_text())
    assert code == 0
    assert [(row['map'], row['preset']) for row in rows] == [
        ('sgbm', 'live'), ('hitnet', 'live'), ('SGBM 3-way + weighted median', 'peer')]
    assert rows[1]['given_bad_1_all'] == 0.0
    assert rows[0]['given_bad_1_all'] == rows[2]['given_bad_1_all'] < 10.0
    assert rows[2]['after_bad_1_all'] < 10.0
    assert rows[0]['ms'] > 0
    assert '| hitnet, live | eth3d (1) | 1 | 0.00 |' in capsys.readouterr().out

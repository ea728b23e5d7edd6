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

"""What is read out of rows: the claim, the v2 average, the tables."""

import pytest

from stereo_refine_ros.evaluation.tables import (
    align, check_claim, claim_text, compare, format_number, improves, markdown_table, text_table,
    v2_average)


def row(stage, mse, ssim, bad, scene='cones', filter_method='box', projection='full'):
    """Make one row with the figures that matter here."""
    return {'scene': scene, 'matching': 'sgbm', 'filter': filter_method,
            'projection': projection, 'stage': stage, 'mse': mse, 'mse_all_pixels': mse,
            'psnr': -mse, 'ssim': ssim, 'bad_0_5': bad, 'bad_1_0': bad, 'bad_2_0': bad,
            'bad_3_0': bad, 'avg_error': bad, 'nonocc': bad, 'all': bad, 'disc': None,
            'density': 1.0, 'confidence_area': None, 'sure_share': None, 'sure_wrong': None,
            'ms': {'matching': 10.0, 'filter': 2.4}}


ROWS = [row('preliminary', 90, 0.7, 9), row('before', 80, 0.8, 5), row('after', 70, 0.9, 6),
        row('preliminary', 90, 0.7, 9, filter_method='none'),
        row('before', 80, 0.8, 5, filter_method='none'),
        row('after', 80, 0.75, 4, filter_method='none'),
        row('before', 80, 0.8, 5, projection='guarded'),
        row('preliminary', 90, 0.7, 9, projection='guarded'),
        row('after', 60, 0.85, 5, projection='guarded')]


def test_comparisons_join_the_stages():
    pairs = compare(ROWS)
    assert [pair.name for pair in pairs] == [
        'cones sgbm + box', 'cones sgbm + none', 'cones sgbm + box']
    assert (pairs[2].preliminary['mse'], pairs[2].before['mse'], pairs[2].after['mse']
            ) == (90, 80, 60)
    assert improves(pairs[0], 'mse')
    assert improves(pairs[0], 'psnr')
    assert not improves(pairs[0], 'bad_1_0')
    assert not improves(pairs[1], 'mse')


def test_claim_counts_strict_improvements_by_projection():
    full, guarded = check_claim(ROWS)
    assert (full.projection, full.combinations) == ('full', 2)
    assert full.improved == {'mse': 1, 'psnr': 1, 'ssim': 1}
    assert full.failures == ['cones sgbm + none (mse, psnr, ssim)']
    assert full.bad_raised == ['cones sgbm + box']
    assert guarded.improved == {'mse': 1, 'psnr': 1, 'ssim': 1}
    assert (guarded.failures, guarded.bad_raised) == ([], [])
    assert claim_text(guarded) == [
        'guarded: MSE falls in 1 of 1 combinations, PSNR rises in 1, SSIM in 1; '
        'bad-1.0 rises in 0.']
    assert len(claim_text(full)) == 3


def test_v2_average_needs_all_twelve_columns():
    rows = [{**row('after', 1, 1, bad, scene), 'disc': bad + 3}
            for bad, scene in enumerate(('Tsukuba', 'venus', 'teddy', 'cones'))]
    assert v2_average(rows) == pytest.approx(1.5 + 1)
    assert v2_average(rows[1:]) is None
    assert v2_average([*rows[:3], {**rows[3], 'disc': None}]) is None


def test_terminal_table_shows_each_map_once():
    lines = text_table(ROWS).splitlines()
    assert len(lines) == 1 + 1 + 2 + 3
    assert lines[1].split() == [
        'cones', 'sgbm', 'preliminary', '90.0', '90.0', '-90.00', '0.7000', '9.00', '9.00',
        '9.00', '9.00', '9.000', '9.00', '9.00', '-', '1.000', '-', '-', '-', '12']


def test_small_formats():
    assert format_number(None, 2) == format_number(float('nan'), 2) == '-'
    assert format_number(1.005, 1) == '1.0'
    assert align([['a', 'bb'], ['ccc', 'd']], left=1) == 'a    bb\nccc   d'
    assert markdown_table(['x', 'y'], [['1', '2']]) == '| x | y |\n| --- | ---: |\n| 1 | 2 |'

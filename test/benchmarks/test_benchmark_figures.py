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

"""The figures of the speed and live benchmarks, from times and stamps made by hand."""

import against_filters
import live
import numpy as np
import opencv_methods
import pytest
import report
import speed
import timing


def test_quartiles():
    assert timing.quartiles([1.0, 2.0, 3.0, 4.0, 5.0]) == (2.0, 3.0, 4.0)
    assert timing.quartiles([7.0]) == (7.0, 7.0, 7.0)


def test_every_method_has_its_turn_and_the_first_call_does_not_count():
    calls = []
    times, results = timing.time_rounds(
        {'a': lambda: calls.append('a') or 1, 'b': lambda: calls.append('b') or 2}, 4, 10.0)
    assert ''.join(calls) == 'ab' * 5
    assert {name: len(values) for name, values in times.items()} == {'a': 4, 'b': 4}
    assert results == {'a': 1, 'b': 2}


def test_slow_method_sits_out_but_has_three_rounds():
    times, _ = timing.time_rounds({'slow': lambda: None}, 10, 0.0)
    assert len(times['slow']) == 3


def test_live_figures():
    sample = live.Sample(
        stamps_in=[0.1 * i for i in range(101)],
        stamps_out=[0.1 * i for i in range(101) if i % 10],
        received_ms=[20.0] * 45 + [30.0] * 45, published_ms=[10.0] * 90,
        memory_mb=[100.0, 100.0, 110.0, 110.0, 113.0, 113.0])
    figures = live.figures(sample)
    assert figures['rate_in_hz'] == pytest.approx(10.0)
    assert figures['rate_out_hz'] == pytest.approx(89 / 9.8)
    assert figures['dropped_percent'] == pytest.approx(100.0 * 10 / 96)
    assert figures['stamp_to_publish_ms_p99'] == 10.0
    assert figures['stamp_to_receive_ms_p50'] == 25.0
    assert figures['latency_growth_ms'] == 10.0
    assert figures['memory_peak_mb'] == 113.0
    assert figures['memory_growth_mb'] == pytest.approx(3.0)


def test_stage_ratios_are_taken_within_each_process():
    stages = {'matching': [50.0], 'segmentation': [10.0], 'planes': [15.0], 'filter': [5.0]}
    rows = [
        speed.Row('s', '4x3x2', 'live', (80.0, 80.0, 80.0), 1.6, 3.0, stages),
        speed.Row('s', '4x3x2', 'graph segmentation', (90.0, 90.0, 90.0), 3.0, None)]
    line = report.stage_table(rows).splitlines()[2]
    # SGBM 3-way took 80 / 1.6 = 50 ms: refinement 30 / 50, segmentation (10 / 50) / 3.
    assert line.endswith('| 0.60 | 0.067 |')


def test_growth_is_per_pixel_and_disparity():
    row = speed.Row('s', '100x10x5', 'live', (1.0, 2.0, 3.0), 1.0, None)
    assert report.growth_table([row]).splitlines()[2].endswith('| 2000 | 400.00 |')


def test_padding_finds_the_left_border_too():
    generator = np.random.default_rng(3)
    scene = generator.integers(0, 255, (40, 120, 3), np.uint8)
    views = (scene[:, :100], scene[:, 7:107])
    full = opencv_methods.match_padded(views, 16)
    assert full.shape == (40, 100)
    assert np.nanmedian(full[:, 10:]) == pytest.approx(7.0, abs=0.1)
    assert opencv_methods.fill_rows(np.array([[np.nan, 2, np.nan, 5]])).tolist() == [[2, 2, 2, 5]]


def test_plot_is_drawn(tmp_path):
    rows = [speed.Row('s', '4x3x2', name, (1.0, 2.0, 3.0), 1.0, 5.0) for name in ('SGBM', 'live')]
    report.plot(rows, tmp_path / 'docs' / 'speed.svg')
    assert '<svg' in (tmp_path / 'docs' / 'speed.svg').read_text(encoding='utf-8')


def test_live_is_named_where_a_filter_is_as_good_or_it_is_worse_than_its_input():
    wls, median = against_filters.FILTERS
    errors = {against_filters.INPUT: 5.0, wls: 6.0, median: 7.0,
              'worse': 5.5, 'equal': 5.0, 'better': 4.0, 'nothing': float('nan')}
    assert against_filters.beaten(errors) == ['worse: 5.50', 'nothing: nan']
    errors[median] = 4.0
    assert against_filters.beaten(errors) == [
        'worse: 5.50', 'equal: 5.00', 'better: 4.00', 'nothing: nan']

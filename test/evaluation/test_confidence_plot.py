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

"""The plots of a confidence: where their lines run."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest
from stereo_refine_ros.evaluation.confidence_plot import (
    confidence_row, confidence_table, reliability_svg, sparsification_svg)
from stereo_refine_ros.quality.confidence import reliability, sparsification_curve

LEFT, RIGHT, TOP, BASE = 34.0, 184.0, 8.0, 108.0


def paths(svg):
    """Return the points of every coloured line by its colour."""
    return {path.get('stroke'): [tuple(map(float, point.split())) for point in
                                 re.split('[ML]', path.get('d'))[1:]]
            for path in ElementTree.fromstring(svg).iter('path')
            if path.get('stroke') != 'currentColor'}


def test_sparsification_lines():
    # The surest is right, the next wrong, the last two right; one of four is wrong.
    wrong = np.array([False, True, False, False])
    svg = sparsification_svg(sparsification_curve([0.9, 0.8, 0.5, 0.2], wrong), wrong)
    lines = paths(svg)
    quarter = (RIGHT - LEFT) / 4
    at = [LEFT + quarter * i for i in (1, 2, 3, 4)]
    heights = [0, 1 / 2, 1 / 3, 1 / 4]  # the highest is the top of the plot
    assert np.ravel(lines['#0072b2']) == pytest.approx(np.ravel(
        [(x, BASE - 2 * y * (BASE - TOP)) for x, y in zip(at, heights, strict=True)]), abs=0.06)
    assert lines['#009e73'] == [
        (pytest.approx(x, abs=0.06), y) for x, y in zip(at, (BASE, BASE, BASE, 58.0), strict=True)]
    assert lines['#999'] == [(LEFT, 58.0), (RIGHT, 58.0)]
    assert '>50 %<' in svg


def test_a_map_without_errors_is_drawn_too():
    wrong = np.zeros(1000, bool)
    lines = paths(sparsification_svg(sparsification_curve(np.linspace(0, 1, 1000), wrong), wrong))
    assert {y for _, y in lines['#0072b2']} == {BASE}
    assert len(lines['#0072b2']) == 100


def test_reliability_dots():
    svg = reliability_svg(reliability([0.25, 0.25, 0.95, 0.95], [True, False, False, False]))
    lines = paths(svg)
    assert lines['#999'] == [(LEFT, BASE), (RIGHT, TOP)]
    expected = [(LEFT + 0.25 * 150, 58.0), (LEFT + 0.95 * 150, TOP)]
    assert np.ravel(lines['#0072b2']) == pytest.approx(np.ravel(expected), abs=0.06)
    dots = [(float(dot.get('cx')), float(dot.get('r')))
            for dot in ElementTree.fromstring(svg).iter('circle')]
    assert dots == [(pytest.approx(71.5), pytest.approx(5.0)),
                    (pytest.approx(176.5), pytest.approx(5.0))]


def test_table_row_names_its_method_and_shows_missing_figures_as_dashes():
    figures = {'confidence_area': 0.01234, 'confidence_area_best': None, 'calibration_error': 0.5,
               'density_at_5': 1.0, 'sure_share': 0.25, 'sure_wrong': float('nan')}
    table = confidence_table([confidence_row('a<b', 'sgbm + none', figures, '<svg/>', '<svg/>')])
    assert '<th>a&lt;b<br>sgbm + none</th><td>0.0123</td><td>-</td><td>0.500</td>' in table
    assert '<td>1.000</td><td>0.250</td><td>-</td><td><svg/></td><td><svg/></td>' in table
    assert table.count('<th>') == 1 + 6 + 2 + 1

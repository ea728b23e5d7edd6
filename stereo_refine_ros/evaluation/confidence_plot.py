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

"""The confidence of an evaluation in the report: one table, with two plots for every method."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from html import escape
from typing import Any

import numpy as np

from stereo_refine_ros.evaluation.tables import format_number
from stereo_refine_ros.quality.confidence import Flags, Reliability, Series, sparsification_curve

_WIDTH, _HEIGHT, _LEFT, _TOP, _BOTTOM = 190, 130, 34, 8, 22
_POINTS = 100  # of a curve that stands for every pixel
_MEASURED, _BEST, _RANDOM = '#0072b2', '#009e73', '#999'
_FIGURES = (
    ('confidence_area', 'area', 4), ('confidence_area_best', 'best possible', 4),
    ('calibration_error', 'calibration error', 3), ('density_at_5', 'density at 5 % error', 3),
    ('sure_share', 'share &ge; 0.9', 3), ('sure_wrong', 'of which wrong', 3))

CONFIDENCE_GUIDE = f"""
<p>Confidence is the likelihood that a refined disparity is within 1 px of the truth.
<b>Sparsification</b>: the least sure pixels are removed first; the plot shows the share of wrong
ones among those that remain, over the share that remains:
<span style="color: {_MEASURED}">as measured</span>,
<span style="color: {_BEST}">the best possible order</span>,
<span style="color: {_RANDOM}">no order at all</span>. &ldquo;Area&rdquo; is the mean of the
curve. <b>Reliability</b>: share of right pixels over the confidence that promised it; on the
diagonal promises are kept, above it they are modest. A dot is as large as its share of pixels.
&ldquo;Calibration error&rdquo; is the mean distance from the diagonal.</p>
"""


def confidence_table(rows: Sequence[str]) -> str:
    """Join the rows of `confidence_row` to an HTML table."""
    head = ''.join(f'<th>{title}</th>' for _, title, _ in _FIGURES)
    return (f'<div class="scroll"><table><caption>Confidence of the refined maps, 1 px</caption>'
            f'<thead><tr><th>scene, method</th>{head}<th>sparsification</th>'
            f'<th>reliability</th></tr></thead><tbody>{"".join(rows)}</tbody></table></div>')


def confidence_row(scene: str, method: str, figures: dict[str, Any], curve: str, diagram: str
                   ) -> str:
    """Write one method on one scene: its figures and its two plots, as HTML."""
    cells = ''.join(f'<td>{format_number(figures[name], digits)}</td>'
                    for name, _, digits in _FIGURES)
    return (f'<tr><th>{escape(scene)}<br>{escape(method)}</th>{cells}'
            f'<td>{curve}</td><td>{diagram}</td></tr>')


def sparsification_svg(curve: Series, wrong: Flags) -> str:
    """
    Draw the share of wrong pixels over the share that remains, as inline SVG.

    Parameters
    ----------
    curve : float64 ndarray of shape (N,)
        From `sparsification_curve`.
    wrong : bool ndarray of shape (N,)
        The pixels it was made from.

    """
    density = np.arange(1, curve.size + 1) / curve.size
    best = sparsification_curve((~wrong).astype(np.float32), wrong)
    error = float(np.mean(wrong))
    top = max(float(curve.max()), error) or 1.0
    place = _scale(top)
    lines = [_line([place(0, error), place(1, error)], _RANDOM)]
    for values, color in ((best, _BEST), (curve, _MEASURED)):
        chosen = np.linspace(0, curve.size - 1, min(_POINTS, curve.size)).astype(int)
        lines.append(_line([place(density[i], values[i]) for i in chosen], color))
    return _frame('wrong among the surest, over their share', f'{100 * top:.3g} %', lines)


def reliability_svg(bins: Reliability) -> str:
    """Draw the share of right pixels over the confidence, bin by bin, as inline SVG."""
    place = _scale(1.0)
    drawn = [_line([place(0, 0), place(1, 1)], _RANDOM)]
    filled = np.flatnonzero(bins.share > 0)
    points = [place(bins.predicted[i], bins.observed[i]) for i in filled]
    drawn.append(_line(points, _MEASURED))
    for (x, y), share in zip(points, bins.share[filled], strict=True):
        radius = 1.5 + 5 * float(np.sqrt(share))
        drawn.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius:.1f}" fill="{_MEASURED}" '
                     'fill-opacity="0.6"/>')
    return _frame('right pixels over confidence', '1', drawn)


def _scale(top: float) -> Callable[[float, float], tuple[float, float]]:
    def place(x: float, y: float) -> tuple[float, float]:
        return (_LEFT + x * (_WIDTH - _LEFT - 6),
                _HEIGHT - _BOTTOM - y / top * (_HEIGHT - _TOP - _BOTTOM))
    return place


def _line(points: Sequence[tuple[float, float]], color: str) -> str:
    path = 'L'.join(f'{x:.1f} {y:.1f}' for x, y in points)
    return f'<path d="M{path}" fill="none" stroke="{color}" stroke-width="1.5"/>'


def _frame(title: str, top: str, drawn: Sequence[str]) -> str:
    base = _HEIGHT - _BOTTOM
    return (
        f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" width="{_WIDTH}" height="{_HEIGHT}" role="img" '
        f'font-size="10" fill="currentColor"><title>{title}</title>'
        f'<path d="M{_LEFT} {_TOP}V{base}H{_WIDTH - 6}" fill="none" stroke="currentColor"/>'
        f'<text x="{_LEFT - 3}" y="{_TOP + 8}" text-anchor="end">{top}</text>'
        f'<text x="{_LEFT - 3}" y="{base}" text-anchor="end">0</text>'
        f'<text x="{_LEFT}" y="{_HEIGHT - 8}">0</text>'
        f'<text x="{_WIDTH - 6}" y="{_HEIGHT - 8}" text-anchor="end">1</text>'
        + ''.join(drawn) + '</svg>')

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

"""The evaluation as one HTML file: summary, tables and pictures, readable without a network."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path

import numpy as np

from stereo_refine_ros.evaluation.confidence_plot import (
    CONFIDENCE_GUIDE, confidence_row, confidence_table, reliability_svg, sparsification_svg)
from stereo_refine_ros.evaluation.pictures import (
    color_confidence, color_disparity, color_error, confidence_gradient, data_uri,
    disparity_gradient, draw_segments, error_gradient, ERROR_LIMIT)
from stereo_refine_ros.evaluation.runner import Outcome, Row
from stereo_refine_ros.evaluation.style import STYLE
from stereo_refine_ros.evaluation.tables import (
    check_claim, claim_text, compare, Comparison, format_number, improves)
from stereo_refine_ros.quality.confidence import (
    judged_pixels, reliability, sparsification_curve)
from stereo_refine_ros.types import Image

_FIGURES = (
    ('mse', 'MSE', 1), ('psnr', 'PSNR dB', 2), ('ssim', 'SSIM', 4),
    ('mse_all_pixels', 'MSE all pixels', 1), ('bad_0_5', 'bad 0.5 %', 2),
    ('bad_1_0', 'bad 1.0 %', 2), ('bad_2_0', 'bad 2.0 %', 2), ('bad_3_0', 'bad 3.0 %', 2),
    ('avg_error', 'avg px', 3),
    ('nonocc', 'nonocc %', 2), ('all', 'all %', 2), ('disc', 'disc %', 2))

_HOW_TO_READ = """
<p>Each cell reads <b>before &rarr; after</b>: the normal flow (matching and filter), then the new
framework (matching, segmentation, planes, filter). &#10003; got better, &#10007; got worse.</p>
<p>MSE, PSNR and SSIM compare 8-bit maps at the data set's own scale, over pixels with known
truth; &ldquo;MSE all pixels&rdquo; counts unknown truth as 0. SSIM sets the map to the truth
where that is unknown and leaves out a border of 5 pixels. bad-k is the share of known pixels
off by more than k pixels of disparity; nonocc, all and disc are bad-1.0 in the data set's
evaluation regions. Holes are filled from the background before anything is measured.</p>
"""


class Report:
    """Collects outcomes as they come; keeps their rows and pictures, not their maps."""

    def __init__(self, title: str, command: str) -> None:
        """Start an empty report that names the command which made it."""
        self._title = title
        self._command = command
        self._rows: list[Row] = []
        self._pictures: dict[str, list[str]] = {}
        self._confidence: list[str] = []

    def add(self, outcome: Outcome) -> None:
        """Add one combination: its rows, and its pictures under its scene."""
        self._rows.extend(outcome.rows)
        if _has_confidence(outcome):
            self._confidence.append(_confidence_row(outcome))
        scene = self._pictures.setdefault(outcome.scene.name, [])
        if not scene:
            scene.append(_legend(outcome))
        scene.append(_picture_row(outcome, is_open=len(scene) == 1))

    def write(self, path: Path) -> None:
        """Write the report, creating its folder."""
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(self._html(), encoding='utf-8')

    def _html(self) -> str:
        pictures = ''.join(f'<h3>{escape(name)}</h3>{"".join(parts)}'
                           for name, parts in self._pictures.items())
        return (
            '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
            '<meta name="viewport" content="width=device-width, initial-scale=1">'
            f'<title>{escape(self._title)}</title><style>{STYLE}</style></head><body><main>'
            f'<h1>{escape(self._title)}</h1><pre class="command">{escape(self._command)}</pre>'
            f'<h2>Summary</h2>{_summary(self._rows)}'
            f'<h2>Tables</h2>{_HOW_TO_READ}{_tables(self._rows)}'
            f'<h2>Confidence</h2>{CONFIDENCE_GUIDE}{confidence_table(self._confidence)}'
            f'<h2>Pictures</h2>{pictures}</main></body></html>\n')


def _summary(rows: Sequence[Row]) -> str:
    items = []
    for claim in check_claim(rows):
        first, *rest = claim_text(claim)
        details = ''.join(f'<br><small>{escape(line.strip())}</small>' for line in rest)
        items.append(f'<li>{escape(first)}{details}</li>')
    return f'<ul>{"".join(items)}</ul>'


def _tables(rows: Sequence[Row]) -> str:
    tables: dict[tuple[str, str], list[Comparison]] = {}
    for pair in compare(rows):
        tables.setdefault((pair.after['scene'], pair.after['projection']), []).append(pair)
    return ''.join(_table(f'{scene}, {projection} projection', pairs)
                   for (scene, projection), pairs in tables.items())


def _table(caption: str, pairs: Sequence[Comparison]) -> str:
    head = ''.join(f'<th>{title}</th>' for _, title, _ in _FIGURES)
    body = ''.join(
        f'<tr><th>{escape(pair.after["matching"])}<br>{escape(pair.after["filter"])}</th>'
        + ''.join(_cell(pair, name, digits) for name, _, digits in _FIGURES) + '</tr>'
        for pair in pairs)
    return (f'<div class="scroll"><table><caption>{escape(caption)}</caption>'
            f'<thead><tr><th>matching, filter</th>{head}</tr></thead>'
            f'<tbody>{body}</tbody></table></div>')


def _cell(pair: Comparison, name: str, digits: int) -> str:
    before, after = pair.before[name], pair.after[name]
    if before is None or after is None:
        return '<td>-</td>'
    mark, style = '', 'same'
    if format_number(before, digits) != format_number(after, digits):
        mark, style = ('&#10003;', 'good') if improves(pair, name) else ('&#10007;', 'worse')
    return (f'<td>{format_number(before, digits)} &rarr;<br>'
            f'<b class="{style}">{format_number(after, digits)} {mark}</b></td>')


def _has_confidence(outcome: Outcome) -> bool:
    return outcome.after.confidence.shape == outcome.after.disparity.values.shape


def _confidence_row(outcome: Outcome) -> str:
    scene, after = outcome.scene, outcome.after
    assert scene.truth is not None
    sure, wrong = judged_pixels(after.confidence, after.disparity.values, scene.truth, 1.0,
                                scene.masks.get('all'))
    return confidence_row(
        scene.name, str(outcome.combination), outcome.rows[-1],
        sparsification_svg(sparsification_curve(sure, wrong), wrong),
        reliability_svg(reliability(sure, wrong)))


def _legend(outcome: Outcome) -> str:
    low, high = _range(outcome)
    return (
        '<div class="legend">'
        + _bar(disparity_gradient(), f'{low:.0f} px', f'{high:.0f} px disparity')
        + _bar(error_gradient(), '0 px', f'{ERROR_LIMIT:.0f} px and more error')
        + _bar(confidence_gradient(), '0', '1 confidence')
        + '<span>black: hole; grey in errors: unknown truth</span></div>')


def _bar(gradient: str, low: str, high: str) -> str:
    style = f'background-image: linear-gradient(to right, {gradient})'
    return f'<span>{low} <i class="bar" style="{style}"></i> {high}</span>'


def _range(outcome: Outcome) -> tuple[float, float]:
    truth = outcome.scene.truth
    assert truth is not None
    return float(np.nanmin(truth)), float(np.nanmax(truth))


def _picture_row(outcome: Outcome, is_open: bool) -> str:
    figures = ''.join(
        f'<figure><img src="{data_uri(picture)}" alt="{name}" loading="lazy">'
        f'<figcaption>{name}</figcaption></figure>'
        for name, picture in outcome_pictures(outcome, with_scene=is_open).items())
    return (f'<details{" open" if is_open else ""}><summary>{escape(str(outcome.combination))}'
            f'</summary><div class="pictures">{figures}</div></details>')


def outcome_pictures(outcome: Outcome, with_scene: bool) -> dict[str, Image]:
    """Draw an outcome, by caption; `with_scene` adds the left view and the ground truth."""
    scene = outcome.scene
    assert scene.truth is not None
    low, high = _range(outcome)
    before, after = outcome.before.disparity.values, outcome.after.disparity.values
    pictures = {'left view': scene.pair.left,
                'ground truth': color_disparity(scene.truth, low, high)} if with_scene else {}
    confidence = ({'confidence after': color_confidence(outcome.after.confidence)}
                  if _has_confidence(outcome) else {})
    return {**pictures, 'before': color_disparity(before, low, high),
            'after': color_disparity(after, low, high),
            'error before': color_error(before, scene.truth),
            'error after': color_error(after, scene.truth), **confidence,
            'segments, planes edged white': draw_segments(
                scene.pair.left, outcome.after.segments)}

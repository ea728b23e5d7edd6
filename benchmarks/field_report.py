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

"""The tables of the field benchmark, as Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
import math
import statistics

from field_rows import BAD, bad_key, FieldRow, PEER
from field_scenes import LAB
from stereo_refine_ros.evaluation.tables import format_number, markdown_table

WORSE = 0.1  # points of percent that count as worse
FIELD = 'field'
_CONFIDENCE_HEAD = (
    'area', 'best possible', 'ratio of means', 'share >= 0.9', 'of which wrong',
    'calibration error', 'density at 5 % error')
Group = tuple[str, str, str]


def print_report(rows: Sequence[FieldRow]) -> list[FieldRow]:
    """Print all tables, and every map of ours that became worse; return these."""
    for table in (error_table, threshold_table, confidence_table, scene_table):
        print(table(rows) + '\n')
    ours = [row for row in rows if row.preset != PEER]
    worse = worse_rows(ours)
    print(f'Worse by more than {WORSE} points: {len(worse)} of {len(ours)} maps')
    for row in sorted(worse, key=lambda item: -item.harm):
        print(f'- {row.group} {row.scene}, {row.map}, {row.preset}: '
              f'{row.bad("given"):.2f} -> {row.bad("after"):.2f}')
    return worse


def worse_rows(rows: Sequence[FieldRow]) -> list[FieldRow]:
    """Select the maps that the refinement made worse by more than `WORSE`."""
    return [row for row in rows if row.harm > WORSE]


def error_table(rows: Sequence[FieldRow]) -> str:
    """Mean error of every map, preset and set at its own threshold, and how many are worse."""
    lines = []
    for (name, preset, group), found in _groups(rows).items():
        worst = max(found, key=lambda row: row.harm)
        lines.append([
            f'{name}, {preset}', f'{group} ({len(found)})', f'{found[0].threshold:.0f}',
            *(format_number(_mean(row.bad(stage, region) for row in found), 2)
              for region in ('all', 'nonocc') for stage in ('given', 'after')),
            str(len(worse_rows(found))), f'{worst.harm:+.2f} {worst.scene}',
            format_number(statistics.median(row.figures['ms'] for row in found), 0)])
    return markdown_table(
        ('map, preset', 'set', 'px', 'given all %', 'after all %', 'given nonocc %',
         'after nonocc %', f'worse by > {WORSE}', 'largest change for the worse', 'median ms'),
        lines)


def threshold_table(rows: Sequence[FieldRow]) -> str:
    """Mean error at 1, 2 and 3 px over all known pixels, given -> after."""
    def cell(found: Sequence[FieldRow], threshold: float) -> str:
        keys = (bad_key(stage, threshold, 'all') for stage in ('given', 'after'))
        return ' -> '.join(format_number(_mean_figure(found, key), 2) for key in keys)

    lines = [[f'{name}, {preset}', f'{group} ({len(found)})',
              *(cell(found, threshold) for threshold in BAD)]
             for (name, preset, group), found in _groups(rows).items()]
    return markdown_table(('map, preset', 'set', *(f'bad-{px:.0f} %' for px in BAD)), lines)


def confidence_table(rows: Sequence[FieldRow]) -> str:
    """Mean figures of the confidence at 1 px; `field` is all sets but the lab."""
    lines = []
    for (name, preset, group), found in _groups(rows, with_field=True).items():
        means = [_mean_figure(found, key) for key in (
            'confidence_area', 'confidence_area_best', 'sure_share', 'sure_wrong',
            'calibration_error', 'density_at_5')]
        if math.isnan(means[0]):
            continue
        ratio = means[0] / means[1] if means[1] else math.nan
        lines.append([f'{name}, {preset}', f'{group} ({len(found)})',
                      *(format_number(value, 4) for value in means[:2]),
                      format_number(ratio, 2),
                      *(format_number(value, 3) for value in means[2:])])
    return markdown_table(('map, preset', 'set', *_CONFIDENCE_HEAD), lines)


def scene_table(rows: Sequence[FieldRow]) -> str:
    """Given -> after of every scene at its set's threshold; bold where it became worse."""
    columns = list(dict.fromkeys((row.map, row.preset) for row in rows))
    cells = {(row.group, row.scene, row.map, row.preset): _change(row) for row in rows}
    scenes = list(dict.fromkeys((row.group, row.scene) for row in rows))
    return markdown_table(
        ('scene', *(f'{name}, {preset}' for name, preset in columns)),
        [[f'{group} {scene}', *(cells.get((group, scene, *column), '-') for column in columns)]
         for group, scene in scenes])


def _change(row: FieldRow) -> str:
    text = f'{row.bad("given"):.2f} -> {row.bad("after"):.2f}'
    return f'**{text}**' if row.harm > WORSE else text


def _groups(rows: Sequence[FieldRow], with_field: bool = False) -> dict[Group, list[FieldRow]]:
    """Sort rows by map, preset and set, in the order of their first appearance."""
    groups: dict[Group, list[FieldRow]] = {}
    for name, preset in dict.fromkeys((row.map, row.preset) for row in rows):
        own = [row for row in rows if (row.map, row.preset) == (name, preset)]
        for row in own:
            groups.setdefault((name, preset, row.group), []).append(row)
        outside = [row for row in own if row.group != LAB]
        if with_field and len({row.group for row in outside}) > 1:
            groups[name, preset, FIELD] = outside
    return groups


def _mean_figure(rows: Sequence[FieldRow], name: str) -> float:
    return _mean(row.figures[name] for row in rows)


def _mean(values: Iterable[float]) -> float:
    known = [value for value in values if math.isfinite(value)]
    return sum(known) / len(known) if known else math.nan

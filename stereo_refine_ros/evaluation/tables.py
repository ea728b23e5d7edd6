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

"""What the rows say: comparisons, the paper's claim, plain-text and Markdown tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
import math
from typing import Any

from stereo_refine_ros.evaluation.runner import Row

V2_SCENES = ('tsukuba', 'venus', 'teddy', 'cones')
V2_REGIONS = ('nonocc', 'all', 'disc')

_TERMINAL_COLUMNS = (
    ('mse', 1), ('mse_all_pixels', 1), ('psnr', 2), ('ssim', 4), ('bad_0_5', 2), ('bad_1_0', 2),
    ('bad_2_0', 2), ('bad_3_0', 2), ('avg_error', 3), ('nonocc', 2), ('all', 2), ('disc', 2),
    ('density', 3), ('confidence_area', 4), ('sure_share', 3), ('sure_wrong', 3))


@dataclass(frozen=True)
class Comparison:
    """One combination on one scene: its rows `preliminary`, `before` and `after`."""

    preliminary: Row
    before: Row
    after: Row

    @property
    def name(self) -> str:
        """Name scene, matcher and filter."""
        return f'{self.after["scene"]} {self.after["matching"]} + {self.after["filter"]}'


@dataclass
class Claim:
    """In how many combinations each figure improved, for one projection."""

    projection: str
    combinations: int = 0
    improved: dict[str, int] = field(
        default_factory=lambda: {'mse': 0, 'psnr': 0, 'ssim': 0})
    failures: list[str] = field(default_factory=list)
    bad_raised: list[str] = field(default_factory=list)


def compare(rows: Sequence[Row]) -> list[Comparison]:
    """Group rows into comparisons, in the order of the rows."""
    groups: dict[tuple[str, ...], dict[str, Row]] = {}
    for row in rows:
        key = tuple(row[name] for name in ('scene', 'matching', 'filter', 'projection'))
        groups.setdefault(key, {})[row['stage']] = row
    return [Comparison(**group) for group in groups.values()]


def check_claim(rows: Sequence[Row]) -> list[Claim]:
    """
    Count for each projection where MSE falls and PSNR and SSIM rise, before to after.

    `failures` names the combinations where one of them did not improve, `bad_raised` those
    whose share of wrong pixels (bad-1.0, known pixels) rose.
    """
    claims: dict[str, Claim] = {}
    for pair in compare(rows):
        projection = pair.after['projection']
        claim = claims.setdefault(projection, Claim(projection))
        claim.combinations += 1
        worse = [name for name in claim.improved if not improves(pair, name)]
        for name in claim.improved:
            claim.improved[name] += name not in worse
        if worse:
            claim.failures.append(f'{pair.name} ({", ".join(worse)})')
        if pair.after['bad_1_0'] > pair.before['bad_1_0']:
            claim.bad_raised.append(pair.name)
    return list(claims.values())


def improves(pair: Comparison, name: str) -> bool:
    """Say whether a figure got strictly better; PSNR and SSIM rise, all others fall."""
    change = pair.after[name] - pair.before[name]
    return change > 0 if name in ('psnr', 'ssim') else change < 0


def claim_text(claim: Claim) -> list[str]:
    """Put a claim into sentences."""
    n = claim.combinations
    lines = [f'{claim.projection}: MSE falls in {claim.improved["mse"]} of {n} combinations, '
             f'PSNR rises in {claim.improved["psnr"]}, SSIM in {claim.improved["ssim"]}; '
             f'bad-1.0 rises in {len(claim.bad_raised)}.']
    if claim.failures:
        lines.append('  Not improved: ' + '; '.join(claim.failures) + '.')
    if claim.bad_raised:
        lines.append('  More wrong pixels: ' + '; '.join(claim.bad_raised) + '.')
    return lines


def v2_average(rows: Sequence[Row]) -> float | None:
    """Average the 12 bad-1.0 columns of Middlebury v2; None where a scene or mask is missing."""
    by_scene = {row['scene'].casefold(): row for row in rows}
    columns = [by_scene.get(scene, {}).get(region)
               for scene in V2_SCENES for region in V2_REGIONS]
    known = [value for value in columns if value is not None]
    return sum(known) / len(known) if len(known) == len(columns) else None


def format_number(value: Any, digits: int) -> str:
    """Format one figure; a dash where there is none."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return '-'
    return f'{value:.{digits}f}'


def text_table(rows: Sequence[Row]) -> str:
    """Lay out all rows for a terminal, each preliminary map once."""
    header = ['scene', 'matching', 'stage', 'filter', 'projection',
              *(name for name, _ in _TERMINAL_COLUMNS), 'ms']
    lines, seen = [], set()
    for row in rows:
        own = {'preliminary': ('', ''), 'before': (row['filter'], ''),
               'after': (row['filter'], row['projection'])}[row['stage']]
        label = (row['scene'], row['matching'], row['stage'], *own)
        if label in seen:
            continue
        seen.add(label)
        lines.append([*label, *(format_number(row[name], digits)
                                for name, digits in _TERMINAL_COLUMNS),
                      format_number(sum(row['ms'].values()), 0)])
    return align([header, *lines], left=5)


def align(lines: Sequence[Sequence[str]], left: int) -> str:
    """Align columns with spaces, the first `left` of them to the left."""
    widths = [max(len(line[i]) for line in lines) for i in range(len(lines[0]))]
    return '\n'.join('  '.join(
        cell.ljust(width) if i < left else cell.rjust(width)
        for i, (cell, width) in enumerate(zip(line, widths, strict=True))).rstrip()
        for line in lines)


def markdown_table(header: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """Lay out a Markdown table, the first column to the left and numbers to the right."""
    rule = ['---', *['---:'] * (len(header) - 1)]
    return '\n'.join('| ' + ' | '.join(line) + ' |' for line in (header, rule, *lines))

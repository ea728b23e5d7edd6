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

"""
Accuracy of every matcher before and after refinement, as Markdown tables.

`--check` ends with 1 where refinement made a map worse than it was.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
import sys

from external_maps import external_maps
import numpy as np
from stereo_refine_ros.datasets import list_scenes, load_scene
from stereo_refine_ros.datasets.scene import Scene
from stereo_refine_ros.evaluate import named_value
from stereo_refine_ros.evaluation.progress import Progress
from stereo_refine_ros.evaluation.runner import evaluate_scene, measure_stage, Plan, Row
from stereo_refine_ros.evaluation.tables import (
    format_number, markdown_table, v2_average, V2_REGIONS, V2_SCENES)
from stereo_refine_ros.memory import keep_freed_memory
from stereo_refine_ros.params import FILTERS, MATCHERS, PRESETS, PROJECTIONS
from stereo_refine_ros.pipeline import StereoRefiner
from stereo_refine_ros.quality.disparity_errors import bad_percent
from stereo_refine_ros.refinement.filling import fill_from_background
from stereo_refine_ros.types import FloatMap, StereoPair

TOLERANCE = 0.05  # points of percent
CHECKED = ('bad-1.0 nonocc', 'bad-1.0 all', 'bad-2.0 nonocc', 'bad-2.0 all', 'mse')
_STAGES = {'preliminary': 'matcher', 'after': 'refined'}


@dataclass(frozen=True)
class Entry:
    """Rows of one matcher on one scene, with the figures that `--check` compares."""

    scene: str
    matching: str
    rows: dict[str, Row]
    checked: dict[str, dict[str, float]]

    def violations(self) -> list[str]:
        """Name what refinement made worse by more than the tolerance."""
        before, after = self.checked['preliminary'], self.checked['after']
        return [f'{self.scene} {self.matching}: {name} {before[name]:.2f} -> {after[name]:.2f}'
                for name in CHECKED if name in before
                and after[name] > before[name] + (0 if name == 'mse' else TOLERANCE)]


def main(argv: Sequence[str] | None = None) -> int:
    """Print the tables; return 1 where `--check` found a worse map."""
    keep_freed_memory()
    args = _parser().parse_args(argv)
    names = args.scenes or list_scenes(args.data)
    filters = (args.filter,) if args.filter else ()
    projections = (args.projection,) if args.projection else ()
    plans = {seed: Plan(args.preset, {**dict(args.parameters), 'planes.seed': seed},
                        args.matching, filters, projections, repeat=1) for seed in args.seeds}
    scenes = [load_scene(name, args.data) for name in names]
    entries: dict[int, list[Entry]] = {seed: [] for seed in plans}
    with Progress() as progress:
        for seed, plan in plans.items():
            for scene in scenes:
                seen = _with_noise(scene, args.noise, seed) if args.noise else scene
                for entry in _scene_entries(seen, plan, args.external):
                    entries[seed].append(entry)
                    progress.step(f'seed {seed} {scene.name} {entry.matching}')
    print_tables(entries[args.seeds[0]])
    print_seeds(entries)
    violations = [f'{text} (seed {seed})' for seed, found in entries.items()
                  for entry in found for text in entry.violations()]
    print(f'\nWorse than the matcher: {len(violations)} of '
          f'{sum(map(len, entries.values())) * len(CHECKED)} figures')
    for text in violations:
        print(f'- {text}')
    return 1 if args.check and violations else 0


def print_tables(entries: Sequence[Entry]) -> None:
    """Print the v2 columns, the other scenes, and the averages over all scenes."""
    header = ['bad-1.0 %', *(f'{scene} {region}' for scene in V2_SCENES for region in V2_REGIONS),
              'average']
    print(markdown_table(header, _v2_lines(entries)))
    others = sorted({entry.scene for entry in entries} - set(V2_SCENES))
    if others:
        print()
        print(markdown_table(['bad-1.0 % nonocc / all', *others, 'average'],
                             _other_lines(entries, others)))
    print()
    print(markdown_table(['average over all scenes', 'bad-0.5 %', 'bad-1.0 %', 'bad-2.0 %',
                          'avg error px', 'MSE', 'SSIM'], _average_lines(entries)))


def print_seeds(entries: dict[int, list[Entry]]) -> None:
    """Print the spread of the v2 average over the seeds."""
    if len(entries) < 2:
        return
    for matching in _matchings(next(iter(entries.values()))):
        averages = [v2_average(_rows(found, matching, 'after')) for found in entries.values()]
        known = [value for value in averages if value is not None]
        if known:
            print(f'\n{matching}, v2 average over seeds {", ".join(map(str, entries))}: '
                  f'{min(known):.3f} to {max(known):.3f}, mean {sum(known) / len(known):.3f}')


def _with_noise(scene: Scene, sigma: float, seed: int) -> Scene:
    """Add Gaussian noise of `sigma` grey levels to both views, as a camera's sensor does."""
    rng = np.random.default_rng(seed)
    noisy = [np.clip(np.rint(view + rng.normal(0, sigma, view.shape)), 0, 255).astype(np.uint8)
             for view in (scene.pair.left, scene.pair.right)]
    return replace(scene, pair=StereoPair(*noisy))


def _scene_entries(scene: Scene, plan: Plan, with_external: bool) -> Iterator[Entry]:
    for outcome in evaluate_scene(scene, plan):
        yield _entry(scene, outcome.combination.matching,
                     outcome.before.preliminary.values, outcome.after.disparity.values)
    if not with_external:
        return
    params = plan.params(plan.combinations()[0], scene.num_disparities).updated(
        {'matching.method': 'external'})
    for name, values in external_maps(scene).items():
        result = StereoRefiner(params).process(scene.pair.left, scene.pair.right, values)
        yield _entry(scene, f'external {name}', values, result.disparity.values)


def _entry(scene: Scene, matching: str, preliminary: FloatMap, after: FloatMap) -> Entry:
    maps = {'preliminary': preliminary, 'after': after}
    rows: dict[str, Row] = {stage: {'scene': scene.name, **measure_stage(values, scene)}
                            for stage, values in maps.items()}
    checked = {stage: {**_bad(values, scene), 'mse': rows[stage]['mse']}
               for stage, values in maps.items()}
    return Entry(scene.name, matching, rows, checked)


def _bad(values: FloatMap, scene: Scene) -> dict[str, float]:
    assert scene.truth is not None
    filled = fill_from_background(values)
    return {f'bad-{threshold} {region}': bad_percent(
        filled, scene.truth, threshold, scene.masks[region])
        for threshold in (1.0, 2.0) for region in ('nonocc', 'all') if region in scene.masks}


def _matchings(entries: Sequence[Entry]) -> list[str]:
    return list(dict.fromkeys(entry.matching for entry in entries))


def _rows(entries: Sequence[Entry], matching: str, stage: str) -> list[Row]:
    return [entry.rows[stage] for entry in entries if entry.matching == matching]


def _lines(entries: Sequence[Entry]) -> list[tuple[str, list[Row]]]:
    return [(f'{matching}, {label}', _rows(entries, matching, stage))
            for matching in _matchings(entries) for stage, label in _STAGES.items()]


def _v2_lines(entries: Sequence[Entry]) -> list[list[str]]:
    lines = []
    for label, rows in _lines(entries):
        by_scene = {row['scene']: row for row in rows}
        cells = [format_number(by_scene.get(scene, {}).get(region), 2)
                 for scene in V2_SCENES for region in V2_REGIONS]
        lines.append([label, *cells, format_number(v2_average(rows), 2)])
    return lines


def _other_lines(entries: Sequence[Entry], others: Sequence[str]) -> list[list[str]]:
    lines = []
    for label, rows in _lines(entries):
        chosen = [row for scene in others for row in rows if row['scene'] == scene]
        cells = [_pair(row['nonocc'], row['all']) for row in chosen]
        lines.append([label, *cells, _pair(_mean(chosen, 'nonocc'), _mean(chosen, 'all'))])
    return lines


def _average_lines(entries: Sequence[Entry]) -> list[list[str]]:
    figures = (('bad_0_5', 2), ('bad_1_0', 2), ('bad_2_0', 2), ('avg_error', 3), ('mse', 1),
               ('ssim', 4))
    return [[label, *(format_number(_mean(rows, name), digits) for name, digits in figures)]
            for label, rows in _lines(entries)]


def _pair(first: float | None, second: float | None) -> str:
    return f'{format_number(first, 2)} / {format_number(second, 2)}'


def _mean(rows: Sequence[Row], name: str) -> float | None:
    known = [row[name] for row in rows if row[name] is not None]
    return sum(known) / len(known) if known else None


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--data', type=Path, help='folder that holds the scene folders')
    parser.add_argument('--scenes', type=_names, help='comma-separated; default: all')
    parser.add_argument('--preset', default='accurate', choices=PRESETS)
    parser.add_argument('--matching', type=_names,
                        default=tuple(name for name in MATCHERS if name != 'external'))
    parser.add_argument('--filter', choices=FILTERS, help="default: the preset's")
    parser.add_argument('--projection', choices=PROJECTIONS, help="default: the preset's")
    parser.add_argument('--seeds', type=lambda text: [int(part) for part in text.split(',')],
                        default=[0], help='comma-separated seeds of the plane hypotheses')
    parser.add_argument('-p', dest='parameters', type=named_value, action='append', default=[],
                        metavar='NAME=VALUE', help='a parameter by its dotted name; repeatable')
    parser.add_argument('--external', action='store_true',
                        help='refine disturbed external maps too')
    parser.add_argument('--noise', type=float, default=0.0, metavar='SIGMA',
                        help='grey levels of noise added to the images, drawn by the seed')
    parser.add_argument('--check', action='store_true',
                        help='end with 1 where a refined map is worse than its input')
    return parser


def _names(text: str) -> tuple[str, ...]:
    return tuple(part.strip() for part in text.split(',') if part.strip())


if __name__ == '__main__':
    sys.exit(main())

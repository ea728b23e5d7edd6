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
Speed beside error, beside OpenCV's own methods, all in one run.

Prints Markdown tables and draws the plot for docs/. Times are medians of rounds in which
every method has its turn; ratios are to OpenCV's SGBM 3-way of the same run. Errors are the
share of pixels with known truth that are off by more than 1 px (KITTI 3 px), holes filled from
the background.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cases import Case, CASES, field_cases, load_case
from contrib import run_contrib
import numpy as np
from opencv_methods import BASE, plain_methods
from report import growth_table, method_table, plot, stage_table
from stereo_refine_ros.datasets import find_data
from stereo_refine_ros.evaluation.progress import Progress
from stereo_refine_ros.matching import MATCHERS
from stereo_refine_ros.memory import keep_freed_memory
from stereo_refine_ros.params import load_preset, PRESETS
from stereo_refine_ros.pipeline import StereoRefiner
from stereo_refine_ros.quality.disparity_errors import bad_percent
from stereo_refine_ros.refinement.filling import fill_from_background
from stereo_refine_ros.types import RefinementResult
from timing import quartiles, time_rounds


@dataclass
class Row:
    """One method on one case: quartiles in ms, ratio to the base, wrong pixels in percent."""

    scene: str
    size: str
    method: str
    ms: tuple[float, float, float]
    ratio: float
    bad: float | None
    stages: dict[str, list[float]] = field(default_factory=dict)


StageLog = dict[str, dict[str, list[float]]]


def own_methods(case: Case, matchers: bool, log: StageLog
                ) -> dict[str, Callable[[], RefinementResult]]:
    """Return every preset, and the live preset with every other matcher; stages go to `log`."""
    names = {preset: {'preset': preset} for preset in PRESETS}
    if matchers:
        names |= {f'live, {name}': {'preset': 'live', 'matching.method': name}
                  for name in MATCHERS if name != load_preset('live').matching.method}
    methods = {}
    for name, values in names.items():
        preset = values.pop('preset')
        refiner = StereoRefiner(load_preset(
            preset, {**values, 'matching.num_disparities': case.num_disparities}))
        methods[name] = _logged(refiner, case, log.setdefault(name, {}))
    return methods


def _logged(refiner: StereoRefiner, case: Case, log: dict[str, list[float]]
            ) -> Callable[[], RefinementResult]:
    def process() -> RefinementResult:
        result = refiner.process(case.left, case.right)
        for stage, ms in result.stage_ms.items():
            log.setdefault(stage, []).append(ms)
        return result
    return process


def measure_case(case: Case, options: argparse.Namespace) -> list[Row]:
    """Time all methods on one pair: ours and OpenCV's here, opencv-contrib's in its process."""
    views = (case.left, case.right)
    log: StageLog = {}
    methods: dict[str, Callable[[], Any]] = {
        **plain_methods(views, case.num_disparities), **own_methods(case, options.matchers, log)}
    times, results = time_rounds(methods, options.rounds, options.budget)
    rows = [_row(case, name, times, results[name], log) for name in methods]
    if options.contrib_python:
        times, maps = run_contrib(options.contrib_python, views, case.num_disparities,
                                  options.rounds, options.budget)
        rows += [_row(case, name, times, maps[name]) for name in times if name != BASE]
    return rows


def _row(case: Case, name: str, times: dict[str, list[float]], result: Any,
         log: StageLog | None = None) -> Row:
    # The first call compiled the kernels.
    stages = {stage: ms[1:] for stage, ms in (log or {}).get(name, {}).items()}
    if isinstance(result, RefinementResult):
        result = result.disparity.values
    is_map = result.dtype == np.float32
    bad = bad_percent(
        fill_from_background(result), case.truth, case.threshold) if is_map else None
    ratio = quartiles(times[name])[1] / quartiles(times[BASE])[1]
    return Row(case.scene, case.size, name, quartiles(times[name]), ratio, bad, stages)


def measure_growth(options: argparse.Namespace) -> list[Row]:
    """Time the live preset and the base while the pixels, then the disparities, grow."""
    sizes = [(320, 240, 64), (640, 480, 64), (960, 720, 64), (1280, 960, 64),
             (640, 480, 32), (640, 480, 128), (640, 480, 256)]
    rows = []
    for width, height, disparities in sizes:
        case = load_case('venus', width, height, max(disparities, 64))
        case = Case(case.scene, case.left, case.right, case.truth, disparities)
        methods: dict[str, Callable[[], Any]] = {
            BASE: plain_methods((case.left, case.right), disparities)[BASE],
            'live': own_methods(case, matchers=False, log={})['live']}
        times, results = time_rounds(methods, options.rounds, options.budget)
        rows += [_row(case, name, times, results[name]) for name in methods]
    return rows


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--rounds', type=int, default=15)
    parser.add_argument('--budget', type=float, default=10.0, help='seconds per method and pair')
    parser.add_argument('--size', help='only this size, such as 640x480x64')
    parser.add_argument('--scenes', choices=('sizes', 'field'), default='sizes',
                        help='lab scenes at the sizes of cameras, or the field scenes as they are')
    parser.add_argument('--data', type=Path,
                        help='folder that holds field/; default: ../shared')
    parser.add_argument('--no-matchers', dest='matchers', action='store_false',
                        help='leave out the live preset with other matchers')
    parser.add_argument('--no-growth', dest='growth', action='store_false',
                        help='leave out the growth with pixels and disparities')
    parser.add_argument('--contrib-python', help='python of an environment with opencv-contrib')
    parser.add_argument('--plot', type=Path, help='where to draw time against error')
    return parser.parse_args()


def chosen_cases(options: argparse.Namespace) -> Iterator[Case]:
    """Yield the pairs that the command line asks for."""
    if options.scenes == 'field':
        yield from field_cases(options.data or find_data().parent)
        return
    for name, width, height, disparities in CASES:
        if options.size in (None, f'{width}x{height}x{disparities}'):
            yield load_case(name, width, height, disparities)


def main() -> None:
    """Measure, print, draw."""
    keep_freed_memory()
    options = parse()
    rows: list[Row] = []
    with Progress() as progress:
        for case in chosen_cases(options):
            rows += measure_case(case, options)
            progress.step(f'{case.size} {case.scene}')
    print(method_table(rows))
    print(stage_table(rows))
    if options.growth and options.scenes == 'sizes':
        print(growth_table(measure_growth(options)))
    if options.plot:
        plot(rows, options.plot)


if __name__ == '__main__':
    main()

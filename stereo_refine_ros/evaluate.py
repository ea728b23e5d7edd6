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
Command line of the offline evaluation: table, JSON, report; bags and image sequences.

Ends with 0, with 1 where something could not be done, and with 3 where all was measured but
messages that were damaged.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Sequence
import json
from pathlib import Path
import shlex
import sys
from typing import Any

from stereo_refine_ros.datasets import find_data, iterate_folder, list_scenes, load_scene
from stereo_refine_ros.datasets.folder import iterate_globs
from stereo_refine_ros.evaluation.pictures import frame_sheet, write_picture
from stereo_refine_ros.evaluation.plot import plot_svg
from stereo_refine_ros.evaluation.progress import Progress
from stereo_refine_ros.evaluation.report import Report
from stereo_refine_ros.evaluation.runner import as_json, evaluate_scene, Plan, Row
from stereo_refine_ros.evaluation.tables import check_claim, claim_text, text_table
from stereo_refine_ros.evaluation.video import (
    average, bag_frames, CameraAdvice, Frame, FrameRow, measure_video, sequence_frames, Show,
    suggested_disparities, write_csv)
from stereo_refine_ros.memory import keep_freed_memory
from stereo_refine_ros.params import FILTERS, MATCHERS, Params, PRESETS, PROJECTIONS
from stereo_refine_ros.types import RefinementResult, StereoPair
import yaml

_DAMAGED = 3  # exit code
_MOST_NAMED = 5


def main(argv: Sequence[str] | None = None) -> int:
    """Run `evaluate`; return 0, 3 for messages left out, or 1 after one line of what is wrong."""
    argv = sys.argv[1:] if argv is None else list(argv)
    args = _parser().parse_args(argv)
    keep_freed_memory()
    try:
        plan = Plan(args.preset, dict(args.parameters), args.matching, args.filters,
                    args.projection, args.repeat)
        if bool(args.left) != bool(args.right):
            raise ValueError('--left GLOB and --right GLOB go together')
        if args.bag or args.sequence or args.left:
            return _DAMAGED if evaluate_video(args, plan) else 0
        else:
            evaluate_scenes(args, plan, shlex.join(argv))
    except (ValueError, FileNotFoundError, ConnectionError, ModuleNotFoundError) as error:
        print(f'evaluate: {error}', file=sys.stderr)
        return 1
    return 0


def evaluate_scenes(args: argparse.Namespace, plan: Plan, arguments: str) -> None:
    """Evaluate scenes with ground truth; print the table, write what was asked for."""
    names = args.scenes or list_scenes(args.data)
    if not names:
        raise FileNotFoundError(f'no scenes in {find_data(args.data)}')
    report = Report('Disparity refinement: before and after',
                    f'python -m stereo_refine_ros.evaluate {arguments}')
    rows: list[Row] = []
    with Progress(len(names) * len(plan.combinations())) as progress:
        for name in names:
            scene = load_scene(name, args.data)
            for outcome in evaluate_scene(scene, plan):
                rows.extend(outcome.rows)
                if args.output:
                    report.add(outcome)
                progress.step(f'{scene.name} {outcome.combination}')
    print(text_table(rows))
    for claim in check_claim(rows):
        print('\n'.join(claim_text(claim)))
    if args.json:
        args.json.parent.mkdir(parents=True, exist_ok=True)
        args.json.write_text(json.dumps(as_json(rows), indent=1, allow_nan=False) + '\n')
    if args.output:
        report.write(args.output / 'report.html')
        print(f'wrote {args.output / "report.html"}')


def evaluate_video(args: argparse.Namespace, plan: Plan) -> int:
    """
    Run a bag or an image sequence through the core; write CSV and plot, print averages.

    Returns
    -------
    int
        How many messages were damaged and left out.

    """
    suggested = suggested_disparities(args.sequence) if args.sequence else None
    params = plan.params(plan.combinations()[0], suggested)
    damaged: list[str] = []
    folder = args.output or Path('evaluate_output')
    rows: list[FrameRow] = []
    advice, draw = CameraAdvice(params), _drawing(args.pictures, folder)

    def look(number: int, pair: StereoPair, result: RefinementResult) -> None:
        advice.add(result)
        draw(number, pair, result)
    try:
        with Progress() as progress:
            for row in measure_video(_frames(args, params, damaged.append), params, look):
                rows.append(row)
                progress.step(f'{row["total_ms"]:.0f} ms')
    finally:  # what was measured before the file broke off is kept
        for text in damaged[:_MOST_NAMED]:
            print(f'evaluate: left out: {text}', file=sys.stderr)
        if damaged:
            print(f'evaluate: {len(damaged)} damaged messages left out', file=sys.stderr)
        if rows:
            title = f'{_video_name(args)}: {plan.preset}, {plan.combinations()[0]}'
            _write_video(folder, rows, title)
            print('\n'.join(advice.lines()) or 'cameras: nothing wrong was seen')
    if not rows:
        raise ValueError(f'no stereo pair in {_video_name(args)}')
    return len(damaged)


def _frames(args: argparse.Namespace, params: Params, on_damaged: Callable[[str], None]
            ) -> Iterable[Frame]:
    if args.bag:
        return bag_frames(args.bag, params, args.topics, on_damaged)
    if args.left:
        return sequence_frames(iterate_globs(args.left, args.right))
    return sequence_frames(iterate_folder(args.sequence))


def _video_name(args: argparse.Namespace) -> str:
    return (args.bag or args.sequence or Path(args.left)).name


def _write_video(folder: Path, rows: list[FrameRow], title: str) -> None:
    write_csv(folder / 'metrics.csv', rows)
    (folder / 'metrics.svg').write_text(plot_svg(rows, title), encoding='utf-8')
    for name, value in average(rows).items():
        if name != 'time':
            print(f'{name:<32}{value:10.4f}')
    print(f'{len(rows)} pairs; wrote {folder / "metrics.csv"} and {folder / "metrics.svg"}')


def _drawing(every: int | None, folder: Path) -> Show:
    """Return what draws every so many pairs into a folder, none where that is None."""
    def draw(number: int, pair: StereoPair, result: RefinementResult) -> None:
        if every is not None and number % every == 0:
            folder.mkdir(parents=True, exist_ok=True)
            write_picture(folder / f'{number:06d}.png', frame_sheet(pair.left, result))
    return draw


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='evaluate',
        description='Evaluate disparity refinement against ground truth, before and after.')
    parser.add_argument('--data', metavar='DIR', help='folder that holds the scene folders')
    parser.add_argument('--scenes', type=_names, metavar='a,b', help='default: all in --data')
    parser.add_argument('--preset', default='live', choices=PRESETS)
    matchers = tuple(name for name in MATCHERS if name != 'external')
    parser.add_argument('--matching', type=_names, default=(), metavar='m1,m2',
                        help=f'of {", ".join(matchers)}; default: the preset\'s')
    parser.add_argument('--filters', type=_names, default=(), metavar='f1,f2',
                        help=f'of {", ".join(FILTERS)}; default: the preset\'s')
    parser.add_argument('--projection', type=_names, default=(), metavar='p1,p2',
                        help=f'of {", ".join(PROJECTIONS)}; default: the preset\'s')
    parser.add_argument('-p', dest='parameters', type=named_value, action='append', default=[],
                        metavar='NAME=VALUE', help='a parameter by its dotted name; repeatable')
    parser.add_argument('--repeat', type=_count, default=3, metavar='N',
                        help='runs of each combination, times are medians (default 3)')
    parser.add_argument('--json', type=Path, metavar='FILE', help='write the rows there')
    parser.add_argument('--output', type=Path, metavar='DIR',
                        help='write report.html there (metrics.csv, metrics.svg for a video)')
    parser.add_argument('--topics', type=_names, default=(), metavar='LEFT,RIGHT',
                        help='with --bag: image topics, raw or compressed (default: '
                        '.../left|right/image_rect, image_raw)')
    parser.add_argument('--pictures', type=_count, metavar='N',
                        help='of a video, draw every Nth pair: view, planes, both disparities')
    video = parser.add_mutually_exclusive_group()
    video.add_argument('--bag', type=Path, metavar='PATH',
                       help='measure every pair of a rosbag2 over time instead')
    video.add_argument('--sequence', type=Path, metavar='DIR',
                       help='measure a folder of pairs over time instead, with temporal noise: '
                       'left/ and right/, KITTI, EuRoC (raw, rectified by sensor.yaml) ...')
    video.add_argument('--left', metavar='GLOB',
                       help='measure the pairs of two patterns, in the order of their names')
    parser.add_argument('--right', metavar='GLOB', help='the pattern that goes with --left')
    return parser


def _names(text: str) -> tuple[str, ...]:
    return tuple(part.strip() for part in text.split(',') if part.strip())


def _count(text: str) -> int:
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError('expected at least 1')
    return number


def named_value(text: str) -> tuple[str, Any]:
    """Split NAME=VALUE of a command line, the value read as YAML."""
    name, equals, value = text.partition('=')
    if not equals:
        raise argparse.ArgumentTypeError(f'{text!r} is not NAME=VALUE')
    return name, yaml.safe_load(value)


if __name__ == '__main__':
    sys.exit(main())

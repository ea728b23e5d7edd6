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
Accuracy and confidence on the field scenes and in the lab, for own maps and other people's.

`given` is the map that was refined, `after` what became of it, holes of both filled from the
background along the row. A pixel is wrong when it is off by more than the set's threshold (KITTI
3 px, else 1); `all` counts known pixels, `nonocc` those that the data set says both views see.
`--check` ends with 1 where refinement made a scene worse by more than 0.1 points.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
import json
import multiprocessing
from pathlib import Path
import sys

from field_peers import peer_maps
from field_pictures import draw_changes
from field_report import print_report, worse_rows
from field_rows import as_json, FieldRow, measure_row, PEER
from field_scenes import (
    FieldScene, NETWORK, read_field_scene, scene_folders, SETS)
from stereo_refine_ros.datasets import find_data
from stereo_refine_ros.evaluation.pictures import write_picture
from stereo_refine_ros.evaluation.progress import Progress
from stereo_refine_ros.memory import keep_freed_memory
from stereo_refine_ros.params import load_preset, PRESETS
from stereo_refine_ros.pipeline import StereoRefiner

OWN = 'own'
MAPS = (OWN, 'sgbm', 'bm', NETWORK)


@dataclass(frozen=True)
class Options:
    """What runs on every scene; the same in every worker."""

    presets: tuple[str, ...]
    maps: tuple[str, ...]
    threads: int | None
    peers: bool
    contrib_python: str | None
    pictures: Path | None = None


def measure_scene(task: tuple[Path, str], options: Options) -> list[FieldRow]:
    """Run every map and preset on one scene: (folder, set)."""
    scene = read_field_scene(*task)
    rows = list(_refined(scene, options))
    if options.peers:
        rows += [measure_row(scene, name, PEER, peer) for name, peer in peer_maps(
            scene, options.threads, options.contrib_python)]
    return rows


def _refined(scene: FieldScene, options: Options) -> Iterator[FieldRow]:
    for name in options.maps:
        if name == NETWORK and scene.network is None:
            continue
        for preset in options.presets:
            values = {'matching.num_disparities': scene.num_disparities}
            if name not in (OWN, NETWORK):
                values['matching.method'] = name
            # A refiner of its own: nothing is carried over from another scene.
            result = StereoRefiner(load_preset(preset, values)).process(
                scene.left, scene.right, scene.network if name == NETWORK else None,
                options.threads)
            row = measure_row(scene, name, preset, result)
            if options.pictures is not None and worse_rows([row]):
                write_picture(options.pictures / f'{scene.name}_{name}_{preset}.jpg',
                              draw_changes(scene, result))
            yield row


def measure_all(tasks: Sequence[tuple[Path, str]], options: Options, workers: int
                ) -> list[FieldRow]:
    """Measure all scenes, on as many processes; times mean something on one only."""
    measure = partial(measure_scene, options=options)
    rows: list[FieldRow] = []
    with Progress(len(tasks)) as progress:
        def keep(found: list[FieldRow], task: tuple[Path, str]) -> None:
            rows.extend(found)
            progress.step(f'{task[1]} {task[0].name}')

        if workers == 1:
            keep_freed_memory()
            for task in tasks:
                keep(measure(task), task)
            return rows
        context = multiprocessing.get_context('spawn')
        with ProcessPoolExecutor(
                workers, mp_context=context, initializer=keep_freed_memory) as pool:
            for task, found in zip(tasks, pool.map(measure, tasks), strict=True):
                keep(found, task)
    return rows


def main(argv: Sequence[str] | None = None) -> int:
    """Print the tables; return 1 where `--check` found a scene that became worse."""
    args = _parser().parse_args(argv)
    root = args.data or find_data().parent
    tasks = [(folder, group) for group in args.sets for folder in scene_folders(root, group)]
    options = Options(args.presets, args.maps, args.threads, args.peers or bool(
        args.contrib_python), args.contrib_python, args.pictures)
    if args.pictures:
        args.pictures.mkdir(parents=True, exist_ok=True)
    rows = measure_all(tasks, options, args.workers)
    worse = print_report(rows)
    if args.json:
        args.json.write_text(json.dumps(as_json(rows), indent=1, allow_nan=False) + '\n')
    return 1 if args.check and worse else 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--data', type=Path,
                        help='folder that holds field/ and middlebury/; default: ../shared')
    for name, known in (('sets', SETS), ('presets', PRESETS), ('maps', MAPS)):
        chosen = ('live', 'accurate') if name == 'presets' else known
        parser.add_argument(f'--{name}', type=partial(_names, known=known), default=chosen,
                            help=f'of {",".join(known)}; default {",".join(chosen)}')
    parser.add_argument('--threads', type=int, help="default: the preset's")
    parser.add_argument('--workers', type=int, default=1,
                        help='scenes side by side; above 1 the times mean nothing')
    parser.add_argument('--peers', action='store_true',
                        help='SGBM 3-way and a weighted median on it, beside ours')
    parser.add_argument('--contrib-python',
                        help='python of an environment with opencv-contrib: its filters too')
    parser.add_argument('--pictures', type=Path,
                        help='folder for a picture of every map that became worse')
    parser.add_argument('--json', type=Path, help='write one row a scene, map and preset there')
    parser.add_argument('--check', action='store_true',
                        help='end with 1 where a scene became worse')
    return parser


def _names(text: str, known: Sequence[str]) -> tuple[str, ...]:
    names = tuple(part.strip() for part in text.split(',') if part.strip())
    unknown = set(names) - set(known)
    if unknown or not names:
        raise argparse.ArgumentTypeError(
            f'{", ".join(sorted(unknown)) or "nothing"} is none of {", ".join(known)}')
    return names


if __name__ == '__main__':
    sys.exit(main())

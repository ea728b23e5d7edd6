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

"""Run the demo: `python -m demo`."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import os
from pathlib import Path
import signal
import sys
import time
from typing import TYPE_CHECKING

from demo.acts import Act, choose_acts, row_report
from demo.processes import dds_environment, DemoError, Processes
from demo.table import LiveTable, summary_line
from stereo_refine_ros.params import preset_path

if TYPE_CHECKING:
    from demo.collector import Collector

_FIRST_FRAME_S = 120.0
_SILENCE_S = 10.0
_LONGEST_RUN_S = 60.0
_LONGEST_S = 160.0
_LATER_ACT_S = 4.0
_RATE_HZ = '4'


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the demo; return the exit status."""
    options = _parser().parse_args(arguments)
    output = Path(options.output)
    output.mkdir(parents=True, exist_ok=True)
    acts, note = choose_acts(options.scene, options.data)
    if note:
        print(f'demo: {note}', flush=True)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    os.environ.update(dds_environment(preset_path('live').parent))
    try:
        _run(options, acts, output)
    except DemoError as error:
        print(f'demo: {error}', file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='demo', description='The live node fed over DDS: metrics live, then pictures.')
    parser.add_argument('--scene', help='Middlebury scene, or `synthetic` (default: one of the '
                        'size of a camera where there is one, else the synthetic one)')
    parser.add_argument('--data', help='folder of the scenes (default: STEREO_REFINE_DATA, '
                        '../shared, the cache)')
    parser.add_argument('--preset', default='live', help='preset of the node')
    parser.add_argument('--output', default='demo_output', help='folder of the pictures')
    parser.add_argument('--seconds', type=float, default=10.0,
                        help='how long to run from the first frame on, at most 60')
    return parser


def _run(options: argparse.Namespace, acts: Sequence[Act], output: Path) -> None:
    # Late: ROS reads the environment that main() has set.
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    from demo.collector import Collector

    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    collector = Collector()
    names = ', then '.join(act.scene.name for act in acts)
    print(f'node and replay of {names} start as two processes; '
          'the first start compiles the kernels', flush=True)
    search_range = max(act.scene.num_disparities or 0 for act in acts)
    try:
        with Processes(output, os.environ) as processes:
            processes.start('refine_node', '--ros-args', '-p', f'preset:={options.preset}', '-p',
                            f'matching.num_disparities:={search_range}')
            started = time.monotonic()
            for act in acts:
                seconds = min(options.seconds, _LONGEST_RUN_S)
                if act is not acts[0]:
                    seconds = min(seconds, _LATER_ACT_S)
                _play(act, processes, collector, f'{act.scene.name}, {options.preset}',
                      seconds, started + _LONGEST_S)
                _report(act, collector, output if act is acts[0] else None)
    finally:
        collector.destroy_node()
        rclpy.try_shutdown()


def _play(act: Act, processes: Processes, collector: Collector, title: str, seconds: float,
          deadline: float) -> None:
    """Replay one scene for a while, and show what the node makes of it."""
    collector.begin(with_truth=act.scene.truth is not None)
    processes.start('replay', *act.source, '--loop', '--rate', _RATE_HZ,
                    '--wait', str(_FIRST_FRAME_S))
    _watch(collector, processes, title, seconds, deadline)
    processes.end('replay')


def _report(act: Act, collector: Collector, output: Path | None) -> None:
    """Print what was found, and write the pictures where a folder is given."""
    from demo.pictures import write_pictures

    frame = collector.frame
    assert frame is not None
    scene = act.scene
    print(f'{scene.name}, {len(collector.history)} frames: {summary_line(frame.metrics)}')
    for text in filter(None, (row_report(act, frame.metrics), collector.advice)):
        print(text)
    if output is None:
        return
    doffs = scene.geometry.doffs_px if scene.geometry else 0.0
    files = write_pictures(output, scene, frame.preliminary - doffs, frame.refined - doffs,
                           frame.labels, frame.confidence, frame.metrics)
    print(f'pictures in {output}/: ' + ', '.join(path.name for path in files), flush=True)


def _watch(collector: Collector, processes: Processes, title: str, seconds: float,
           deadline: float) -> None:
    """Show metrics for a while from the first on; raise DemoError when none come."""
    started = last = time.monotonic()
    first = None
    with LiveTable(title) as table:
        while (first is None or not collector.has_frame
               or time.monotonic() - first < seconds):
            processes.check()
            count = len(collector.history)
            collector.spin_for(0.1)
            now = time.monotonic()
            if len(collector.history) > count:
                first, last = first or now, now
                table.update(collector.history[-1], len(collector.history), collector.advice)
            limit = _FIRST_FRAME_S if first is None else _SILENCE_S
            if now - (started if first is None else last) > limit:
                raise DemoError(f'no metrics for {limit:.0f} s\n' + processes.tails())
            if now > deadline:
                raise DemoError(f'no whole frame in {_LONGEST_S:.0f} s\n' + processes.tails())


if __name__ == '__main__':
    sys.exit(main())

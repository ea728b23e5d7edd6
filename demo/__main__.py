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

from stereo_refine_ros.datasets import load_scene, render_scene, Scene
from demo.processes import dds_environment, DemoError, Processes
from demo.table import LiveTable, summary_line
from stereo_refine_ros.params import preset_path

if TYPE_CHECKING:
    from demo.collector import Collector

_FIRST_FRAME_S = 90.0
_SILENCE_S = 10.0
_LONGEST_RUN_S = 60.0
_LONGEST_S = 160.0
_RATE_HZ = '4'


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the demo; return the exit status."""
    options = _parser().parse_args(arguments)
    output = Path(options.output)
    output.mkdir(parents=True, exist_ok=True)
    scene, source = _choose_scene(options)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    os.environ.update(dds_environment(preset_path('live').parent))
    try:
        _run(options, scene, source, output)
    except DemoError as error:
        print(f'demo: {error}', file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='demo', description='The live node fed over DDS: metrics live, then pictures.')
    parser.add_argument('--scene', default='cones', help='Middlebury scene, or `synthetic`')
    parser.add_argument('--data', help='folder of the scenes (default: STEREO_REFINE_DATA, '
                        '../shared, the cache; else downloaded)')
    parser.add_argument('--preset', default='live', help='preset of the node')
    parser.add_argument('--output', default='demo_output', help='folder of the pictures')
    parser.add_argument('--seconds', type=float, default=10.0,
                        help='how long to run from the first frame on, at most 60')
    return parser


def _choose_scene(options: argparse.Namespace) -> tuple[Scene, list[str]]:
    """Return the scene and the options that make `replay` play it."""
    if options.scene != 'synthetic':
        try:
            scene = load_scene(options.scene, options.data)
        except (OSError, ValueError) as error:
            print(f'demo: {error}\ndemo: taking the synthetic scene instead', flush=True)
        else:
            data = ['--data', options.data] if options.data else []
            return scene, ['--scene', options.scene, *data]
    return render_scene(), ['--synthetic']


def _run(options: argparse.Namespace, scene: Scene, source: list[str], output: Path) -> None:
    # Late: ROS reads the environment that main() has set.
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    from demo.collector import Collector
    from demo.pictures import write_pictures

    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    collector = Collector(with_truth=scene.truth is not None)
    print(f'node and replay of {scene.name} start as two processes; '
          'the first start compiles the kernels', flush=True)
    try:
        with Processes(output, os.environ) as processes:
            processes.start('refine_node', '--ros-args', '-p', f'preset:={options.preset}', '-p',
                            f'matching.num_disparities:={scene.num_disparities}')
            processes.start('replay', *source, '--loop', '--rate', _RATE_HZ,
                            '--wait', str(_FIRST_FRAME_S))
            _watch(collector, processes, f'{scene.name}, {options.preset}',
                   min(options.seconds, _LONGEST_RUN_S))
        frame = collector.frame
        assert frame is not None
    finally:
        collector.destroy_node()
        rclpy.try_shutdown()
    doffs = scene.geometry.doffs_px if scene.geometry else 0.0
    files = write_pictures(output, scene, frame.preliminary - doffs, frame.refined - doffs,
                           frame.labels, frame.metrics, frame.confidence)
    print(summary_line(frame.metrics))
    print(f'{len(collector.history)} frames; pictures in {output}/: '
          + ', '.join(path.name for path in files))


def _watch(collector: Collector, processes: Processes, title: str, seconds: float) -> None:
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
                table.update(collector.history[-1], len(collector.history))
            limit = _FIRST_FRAME_S if first is None else _SILENCE_S
            if now - (started if first is None else last) > limit:
                raise DemoError(f'no metrics for {limit:.0f} s\n' + processes.tails())
            if now - started > _LONGEST_S:
                raise DemoError(f'no whole frame in {_LONGEST_S:.0f} s\n' + processes.tails())


if __name__ == '__main__':
    sys.exit(main())

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

"""Publish stereo pairs or a rosbag2 as messages: `replay --help` tells the options."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Sequence
from functools import partial
import signal
import sys

from stereo_refine_ros.datasets.folder import iterate_folder, list_pairs
from stereo_refine_ros.datasets.middlebury import load_scene
from stereo_refine_ros.datasets.scene import Scene
from stereo_refine_ros.datasets.synthetic import render_scene

_DEFAULT_SCENE = 'cones'
_DEFAULT_RATE_HZ = 5.0


def build_parser() -> argparse.ArgumentParser:
    """Return the command line of `replay`, without the ROS arguments."""
    parser = argparse.ArgumentParser(
        prog='replay', description='Publish stereo pairs, or a rosbag2, as messages: '
        'left|right/image_rect, left|right/camera_info, ground_truth/disparity where known. '
        'Remap with --ros-args -r FROM:=TO.')
    source = parser.add_mutually_exclusive_group()
    source.add_argument('--scene', metavar='NAME[,NAME]', help='Middlebury scenes (default: '
                        f'{_DEFAULT_SCENE}); downloaded to the cache where not found')
    source.add_argument('--folder', metavar='DIR', help='left/ and right/ with equal file names, '
                        'or NAME_left.* and NAME_right.*')
    source.add_argument('--synthetic', action='store_true',
                        help='the built-in scene of slanted planes with exact ground truth')
    source.add_argument('--bag', metavar='PATH', help='rosbag2 folder, mcap or sqlite3; '
                        'publishes /clock too')
    parser.add_argument('--data', metavar='DIR', help='folder of the Middlebury scenes '
                        '(default: STEREO_REFINE_DATA, ../shared, the cache)')
    parser.add_argument('--rate', type=_positive, metavar='R', help='pairs a second (default: '
                        f'{_DEFAULT_RATE_HZ:g}); with --bag the speed factor (default: 1)')
    repeat = parser.add_mutually_exclusive_group()
    repeat.add_argument('--once', dest='loops', action='store_const', const=1, default=1,
                        help='play through once (the default)')
    repeat.add_argument('--loop', dest='loops', type=_count, nargs='?', const=0, metavar='N',
                        help='play N times over, without N for ever')
    parser.add_argument('--encoding', choices=('bgr8', 'mono8'), default='bgr8',
                        help='of the images (not with --bag)')
    parser.add_argument('--topics', metavar='A,B', default='',
                        help='with --bag: publish only these recorded topics')
    parser.add_argument('--wait', type=_seconds, default=5.0, metavar='S', help='longest wait '
                        'for subscribers before the first message, 0 for none (default: 5)')
    parser.add_argument('--seed', type=_count, default=0, help='of the synthetic scene')
    return parser


def scene_source(options: argparse.Namespace) -> Callable[[], Iterable[Scene]]:
    """
    Return a function that gives the scenes asked for, anew for every loop.

    Raises
    ------
    FileNotFoundError, ConnectionError, ValueError
        When there is nothing to play.

    """
    if options.folder:
        list_pairs(options.folder)
        return partial(iterate_folder, options.folder)
    if options.synthetic:
        scenes: list[Scene] = [render_scene(options.seed)]
    else:
        names = (options.scene or _DEFAULT_SCENE).split(',')
        scenes = [load_scene(name.strip(), options.data) for name in names]
    return lambda: scenes


def main(args: Sequence[str] | None = None) -> int:
    """Run `replay`; return the exit status."""
    # Late, so that the choice of scenes can be used where there is no ROS.
    import rclpy
    from rclpy.executors import ExternalShutdownException
    from rclpy.utilities import remove_ros_args

    arguments = list(sys.argv if args is None else ['replay', *args])
    options = build_parser().parse_args(remove_ros_args(arguments)[1:])
    rclpy.init(args=arguments)
    try:
        count = _play(options)
    except (KeyboardInterrupt, ExternalShutdownException):
        return 0
    except (OSError, ValueError) as error:
        print(f'replay: {error}', file=sys.stderr)
        return 1
    finally:
        # A second SIGINT, as `ros2 launch` sends it, must not break the clean end.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        rclpy.try_shutdown()
    print(f'replay: published {count} {"messages" if options.bag else "pairs"}')
    return 0


def _play(options: argparse.Namespace) -> int:
    if options.bag:
        from stereo_refine_ros.replay.bag_player import BagPlayer
        topics = [topic for topic in options.topics.split(',') if topic]
        bag_player = BagPlayer(options.bag, topics)
        return bag_player.play(options.rate or 1.0, options.loops, options.wait)
    scenes = scene_source(options)
    from stereo_refine_ros.replay.scene_player import ScenePlayer
    player = ScenePlayer(options.encoding)
    return player.play(scenes, options.rate or _DEFAULT_RATE_HZ, options.loops, options.wait)


def _positive(text: str) -> float:
    value = float(text)
    if not 0.0 < value <= 1000.0:
        raise argparse.ArgumentTypeError(f'{text} is outside 0 to 1000')
    return value


def _seconds(text: str) -> float:
    value = float(text)
    if not 0.0 <= value <= 3600.0:
        raise argparse.ArgumentTypeError(f'{text} is outside 0 to 3600')
    return value


def _count(text: str) -> int:
    value = int(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f'{text} is negative')
    return value


if __name__ == '__main__':
    sys.exit(main())

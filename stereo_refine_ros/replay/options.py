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

"""The command line of `replay`, and the scenes that it asks for."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable
from functools import partial

from stereo_refine_ros.datasets.folder import (
    iterate_folder, iterate_globs, list_pairs, match_globs)
from stereo_refine_ros.datasets.middlebury import load_scene
from stereo_refine_ros.datasets.scene import Scene
from stereo_refine_ros.datasets.synthetic import render_scene
from stereo_refine_ros.replay.keyboard import HELP

DEFAULT_RATE_HZ = 5.0
_DEFAULT_SCENE = 'cones'
_CLOCK_HZ = 100.0


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
                        'NAME_left.* and NAME_right.*, KITTI, EuRoC (raw pairs are rectified) ...')
    source.add_argument('--left', metavar='GLOB', help='images of the left camera, in the order '
                        'of their names; with --right')
    source.add_argument('--synthetic', action='store_true',
                        help='the built-in scene of slanted planes with exact ground truth')
    source.add_argument('--bag', metavar='PATH', help='rosbag2 folder, mcap or sqlite3')
    parser.add_argument('--right', metavar='GLOB', help='images of the right camera')
    parser.add_argument('--data', metavar='DIR', help='folder of the Middlebury scenes '
                        '(default: STEREO_REFINE_DATA, ../shared, the cache)')
    parser.add_argument('-r', '--rate', type=_positive, metavar='R', help='pairs a second '
                        f'(default: {DEFAULT_RATE_HZ:g}); with --bag the speed factor '
                        '(default: 1)')
    repeat = parser.add_mutually_exclusive_group()
    repeat.add_argument('--once', dest='loops', action='store_const', const=1, default=1,
                        help='play through once (the default)')
    repeat.add_argument('-l', '--loop', dest='loops', type=_count, nargs='?', const=0, metavar='N',
                        help='play N times over, without N for ever')
    parser.add_argument('--encoding', choices=('bgr8', 'mono8'), default='bgr8',
                        help='of the images (not with --bag)')
    parser.add_argument('--wait', type=_seconds, default=5.0, metavar='S', help='longest wait '
                        'for subscribers before the first message, 0 for none (default: 5)')
    parser.add_argument('--seed', type=_count, default=0, help='of the synthetic scene')
    parser.add_argument('--row-offset', type=_pixels, default=0.0, metavar='PX', help='the right '
                        'view of the synthetic scene lies so much lower (default: 0)')
    _add_bag_options(parser.add_argument_group('with --bag, as ros2 bag play has them'))
    return parser


def _add_bag_options(group: argparse._ArgumentGroup) -> None:
    group.add_argument('--topics', metavar='A', type=_names, nargs='+', default=[],
                       help='publish only these recorded topics')
    group.add_argument('--exclude-topics', metavar='A', type=_names, nargs='+', default=[],
                       help='do not publish these recorded topics')
    group.add_argument('--start-offset', type=_seconds, default=0.0, metavar='S',
                       help='begin so many seconds into the bag')
    group.add_argument('--playback-duration', type=_seconds, default=0.0, metavar='S',
                       help='end after so many seconds of the bag, 0 for its end')
    group.add_argument('--delay', type=_seconds, default=0.0, metavar='S',
                       help='wait so long before the first message')
    group.add_argument('--clock', type=_positive, nargs='?', const=_CLOCK_HZ, default=0.0,
                       metavar='HZ', help='publish the time of the bag on /clock, for nodes with '
                       f'use_sim_time (HZ default: {_CLOCK_HZ:g})')
    group.add_argument('-p', '--start-paused', action='store_true', help='begin paused')
    group.add_argument('--disable-keyboard-controls', action='store_true',
                       help=f'on a terminal, {HELP}')


def scene_source(options: argparse.Namespace) -> Callable[[], Iterable[Scene]]:
    """
    Return a function that gives the scenes asked for, anew for every loop.

    Raises
    ------
    FileNotFoundError, ConnectionError, ValueError
        When there is nothing to play.

    """
    if bool(options.left) != bool(options.right):
        raise ValueError('--left GLOB and --right GLOB go together')
    if options.left:
        match_globs(options.left, options.right)
        return partial(iterate_globs, options.left, options.right)
    if options.folder:
        list_pairs(options.folder)
        return partial(iterate_folder, options.folder)
    if options.synthetic:
        scenes: list[Scene] = [render_scene(options.seed, row_offset=options.row_offset)]
    else:
        names = (options.scene or _DEFAULT_SCENE).split(',')
        scenes = [load_scene(name.strip(), options.data) for name in names]
    return lambda: scenes


def chosen_topics(options: list[list[str]]) -> list[str]:
    """Flatten what `--topics A,B C` gives."""
    return [name for names in options for name in names]


def _names(text: str) -> list[str]:
    return [name for name in text.split(',') if name]


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


def _pixels(text: str) -> float:
    value = float(text)
    if not -100.0 <= value <= 100.0:
        raise argparse.ArgumentTypeError(f'{text} is outside -100 to 100')
    return value


def _count(text: str) -> int:
    value = int(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f'{text} is negative')
    return value

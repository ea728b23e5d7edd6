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
from collections.abc import Sequence
import os
import sys

from stereo_refine_ros.stop import Stop

_LAST_RESORT_S = 5.0


def main(args: Sequence[str] | None = None) -> int:
    """Run `replay`; return the exit status."""
    stop = Stop(_LAST_RESORT_S)
    # The middleware reads its variables when it is loaded.
    _give_images_room()
    import rclpy
    from rclpy.signals import SignalHandlerOptions
    from rclpy.utilities import remove_ros_args

    from stereo_refine_ros.replay.options import build_parser
    from stereo_refine_ros.shared_memory import fit_to_host

    arguments = list(sys.argv if args is None else ['replay', *args])
    options = build_parser().parse_args(remove_ros_args(arguments)[1:])
    fit_to_host(lambda text: print(f'replay: {text}', file=sys.stderr))
    if not stop.may_open():
        return 0
    try:
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
        stop.on_request = rclpy.try_shutdown  # every wait ends with the context
        count = 0 if stop.requested.is_set() else _play(options)
    except Exception as error:
        if stop.requested.is_set():
            return 0  # the context ended while something was being made in it
        if not isinstance(error, (OSError, ValueError)):
            raise
        print(f'replay: {error}', file=sys.stderr)
        return 1
    finally:
        stop.closes()
        rclpy.try_shutdown()
    print(f'replay: published {count} {"messages" if options.bag else "pairs"}')
    return 0


def _play(options: argparse.Namespace) -> int:
    from stereo_refine_ros.replay.options import chosen_topics, DEFAULT_RATE_HZ, scene_source
    if options.bag:
        from stereo_refine_ros.replay.bag_player import BagPlayer, Excerpt
        from stereo_refine_ros.replay.keyboard import Keyboard
        from stereo_refine_ros.replay.timeline import Timeline
        excerpt = Excerpt(
            tuple(chosen_topics(options.topics)), tuple(chosen_topics(options.exclude_topics)),
            options.start_offset, options.playback_duration)
        timeline = Timeline(options.rate or 1.0, options.start_paused)
        with Keyboard(not options.disable_keyboard_controls) as keyboard:
            return BagPlayer(options.bag, excerpt, timeline, keyboard, options.clock).play(
                options.loops, options.wait, options.delay)
    scenes = scene_source(options)
    from stereo_refine_ros.replay.scene_player import ScenePlayer
    player = ScenePlayer(options.encoding)
    return player.play(scenes, options.rate or DEFAULT_RATE_HZ, options.loops, options.wait)


def _give_images_room() -> None:
    """Use the Fast DDS profile that this package ships, unless something else is chosen."""
    from stereo_refine_ros.dds_profile import profile_variables
    from stereo_refine_ros.params import preset_path
    try:
        config = preset_path('live').parent
    except FileNotFoundError:
        return
    os.environ.update(profile_variables(config, os.environ))


if __name__ == '__main__':
    sys.exit(main())

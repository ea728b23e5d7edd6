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

"""The node behind `replay` for scenes, folders and the synthetic scene."""

from __future__ import annotations

from collections.abc import Callable, Iterable
import time

from rclpy.node import Node
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import CameraInfo, Image
from stereo_msgs.msg import DisparityImage

from stereo_refine_ros.datasets.scene import Scene
from stereo_refine_ros.messages.scene import (
    camera_info_messages, image_message, nominal_geometry, scene_header, truth_message)
from stereo_refine_ros.replay.pacing import (
    REPLAY_QOS, sleep_until, wait_delivered, wait_for_subscribers)
from stereo_refine_ros.types import StereoGeometry

_TOPICS = {
    'left': (Image, 'left/image_rect'), 'right': (Image, 'right/image_rect'),
    'left_info': (CameraInfo, 'left/camera_info'),
    'right_info': (CameraInfo, 'right/camera_info'),
    'truth': (DisparityImage, 'ground_truth/disparity')}
_TRUTH_WAIT_S = 0.5


class ScenePlayer(Node):
    """
    Publish scenes as a stereo camera would, one after another at a rate.

    Parameters
    ----------
    encoding : str
        `bgr8` or `mono8`.

    """

    def __init__(self, encoding: str = 'bgr8') -> None:
        """Create the five publishers."""
        super().__init__('replay')
        self._encoding = encoding
        self._publisher_of = {
            key: self.create_publisher(
                kind, topic, REPLAY_QOS,
                qos_overriding_options=QoSOverridingOptions.with_default_policies())
            for key, (kind, topic) in _TOPICS.items()}

    def play(self, scenes: Callable[[], Iterable[Scene]], rate_hz: float, loops: int,
             wait_s: float) -> int:
        """
        Publish every scene, `loops` times over, and return how many pairs went out.

        Parameters
        ----------
        scenes : callable returning an iterable of Scene
            Called once a loop.
        rate_hz : float
            Pairs a second.
        loops : int
            How often, 0 for ever.
        wait_s : float
            How long to wait for subscribers before the first pair.

        """
        self._wait_for_subscribers(wait_s)
        count, loop, due = 0, 0, time.monotonic()
        while loops == 0 or loop < loops:
            for scene in scenes():
                if not sleep_until(self, due):
                    return count
                self.publish_scene(scene)
                count += 1
                due = max(due + 1.0 / rate_hz, time.monotonic())
            loop += 1
        sleep_until(self, due)
        wait_delivered(self, list(self._publisher_of.values()))
        return count

    def publish_scene(self, scene: Scene) -> None:
        """Publish one pair and its company, all with the stamp of now."""
        if scene.pair.right is None:
            raise ValueError(f'{scene.name}: no right view to publish')
        height, width = scene.pair.shape
        geometry = scene.geometry or nominal_geometry(height, width)
        header = scene_header(self.get_clock().now().to_msg())
        left_info, right_info = camera_info_messages(geometry, height, width, header)
        # The truth first: a subscriber that has the pair should have its truth as well.
        if scene.truth is not None:
            self._publisher_of['truth'].publish(truth_message(scene, geometry, header))
        self._publisher_of['left_info'].publish(left_info)
        self._publisher_of['right_info'].publish(right_info)
        for key, view in (('left', scene.pair.left), ('right', scene.pair.right)):
            self._publisher_of[key].publish(image_message(view, self._encoding, header))
        if scene.geometry is None:
            self._say_nominal(geometry)

    def _say_nominal(self, geometry: StereoGeometry) -> None:
        self.get_logger().warning(
            f'no calibration beside the images: camera_info says f = {geometry.focal_px:g} px and '
            f'a baseline of {geometry.baseline_m:g} m, so depth and points are not to scale; set '
            "the node's camera.focal_length and camera.baseline", once=True)

    def _wait_for_subscribers(self, wait_s: float) -> None:
        cameras = [publisher for key, publisher in self._publisher_of.items() if key != 'truth']
        if wait_s > 0 and not wait_for_subscribers(self, cameras, wait_s):
            self.get_logger().warning(
                f'nobody subscribes to {cameras[0].topic_name} after {wait_s:g} s; '
                'publishing all the same (a stereo node may subscribe only while its own '
                'output has a subscriber)')
        wait_for_subscribers(self, [self._publisher_of['truth']], min(wait_s, _TRUTH_WAIT_S))

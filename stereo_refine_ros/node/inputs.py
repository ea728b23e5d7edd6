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
What the node listens to: subscriptions only while they are needed, images paired by stamp.

Calibration need not share the stamp of the images: that of the stamp serves where it comes in
step with them, else the newest.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import math
import time
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks, UnsupportedEventTypeError
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data, QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from stereo_msgs.msg import DisparityImage

from stereo_refine_ros.node.calibration import Calibration
from stereo_refine_ros.node.frame import (
    LEFT, LEFT_INFO, PRELIMINARY, RIGHT, RIGHT_INFO, stamp_ns, TRUTH)
from stereo_refine_ros.node.topics import input_topic
from stereo_refine_ros.pairing import MessageSet, Pairing
from stereo_refine_ros.params import Params

TYPES: dict[str, type] = {
    LEFT: Image, RIGHT: Image, LEFT_INFO: CameraInfo, RIGHT_INFO: CameraInfo,
    PRELIMINARY: DisparityImage, TRUTH: DisparityImage}
COMPRESSED = '/compressed'
SILENT_S = 2.0
FIRST_CALIBRATION_S = 2.0  # longest wait for the first camera_info
KEEP_S = 3.0  # how long images wait for another matcher


class Inputs:
    """
    Subscriptions and pairing; used by the executor's thread alone.

    Parameters
    ----------
    node : rclpy.node.Node
    params : Params
    on_messages : callable of MessageSet and Calibration
        Called for every complete set.
    on_truth : callable of int and DisparityImage
        Called for every ground truth, with its stamp in nanoseconds.
    on_hold : callable
        Called when a set waits for optional messages: `release` is to be called soon.
    on_incompatible : callable of str
        Told the topic of a publisher whose QoS does not fit.

    """

    def __init__(self, node: Node, params: Params,
                 on_messages: Callable[[MessageSet, Calibration], None],
                 on_truth: Callable[[int, DisparityImage], None],
                 on_hold: Callable[[], None], on_incompatible: Callable[[str], None]) -> None:
        """Listen to nothing yet."""
        self._node = node
        self._on_messages = on_messages
        self._on_truth = on_truth
        self._on_hold = on_hold
        self._on_incompatible = on_incompatible
        self._subscriptions: dict[str, Subscription] = {}
        self._is_compressed = False
        self._newest = Calibration()
        self._early: MessageSet | None = None
        self._unmatched_before = 0
        self._listening_since = 0.0
        self.configure(params)

    @property
    def listening(self) -> bool:
        """Whether there are subscriptions."""
        return bool(self._subscriptions)

    @property
    def holds(self) -> bool:
        """Whether a set waits for optional messages or for the first calibration."""
        return self.pairing.holds or self._early is not None

    @property
    def is_starting(self) -> bool:
        """Whether publishers may still be about to be found."""
        return time.monotonic() - self._listening_since < SILENT_S

    def topics(self) -> list[str]:
        """Name the topics that are subscribed to now."""
        return list(self._subscriptions)

    @property
    def unmatched(self) -> int:
        """Instants for which some topic delivered and another did not, since the start."""
        return self._unmatched_before + self.pairing.unmatched

    def configure(self, params: Params) -> None:
        """Start a new pairing as the parameters ask."""
        self._choose_transport(params.inputs.image_transport == 'compressed')
        if hasattr(self, 'pairing'):
            self._emit(self.pairing.release(math.inf))
            self._unmatched_before += self.pairing.unmatched
        external = params.matching.method == 'external'
        required = (LEFT, PRELIMINARY) if external else (LEFT, RIGHT)
        optional = (RIGHT, LEFT_INFO, RIGHT_INFO) if external else (LEFT_INFO, RIGHT_INFO)
        slop_ns = round(params.sync.slop * 1e9) if params.sync.approximate else 0
        self.pairing = Pairing(required, optional, slop_ns, params.sync.queue_size,
                               KEEP_S if external else 0.0)
        self._waits_for_calibration = params.inputs.rectify or not external and not (
            params.camera.baseline and params.camera.focal_length)
        self._listening_since = time.monotonic()
        for topic in self._subscriptions.keys() & set(optional):
            self.pairing.expect(topic, self._listening_since)

    def listen(self, wanted: bool, with_truth: bool) -> None:
        """Subscribe to what is needed now and to nothing else."""
        needed: set[str] = set()
        if wanted:
            needed = {*self.pairing.required, *self.pairing.optional}
            needed |= {TRUTH} if with_truth else set()
        moved = {topic for topic, subscription in self._subscriptions.items()
                 if subscription.topic_name != self.source(topic)[0]}
        for topic in set(self._subscriptions) - needed | moved:
            self._node.destroy_subscription(self._subscriptions.pop(topic))
        if wanted and not self._subscriptions:
            self._listening_since = time.monotonic()
        for topic in sorted(needed - set(self._subscriptions)):
            self._subscriptions[topic] = self._subscribe(topic)

    def release(self) -> None:
        """Hand on what has waited long enough for its optional messages or calibration."""
        self._emit(self.pairing.release(time.monotonic()))

    def silent_topics(self) -> list[str]:
        """Name images that did not come for `SILENT_S`, and with them a missing calibration."""
        now = time.monotonic()
        if not self.listening or self.is_starting:
            return []
        silent = [name for name in self.pairing.required
                  if now - (self.pairing.topics[name].last_arrival or 0.0) > SILENT_S]
        infos = ((LEFT_INFO, self._newest.left), (RIGHT_INFO, self._newest.right))
        never = [name for name, newest in infos if newest is None and self._waits_for_calibration]
        return silent + never if silent else []

    def truth_is_published(self) -> bool:
        """Whether somebody publishes ground truth now."""
        return self._node.count_publishers(TRUTH) > 0

    def full_name(self, topic: str) -> str:
        """Name a topic, and what it is remapped to."""
        resolved, _ = self.source(topic)
        return topic if resolved == f'/{topic}' else f'{topic} ({resolved})'

    def source(self, topic: str) -> tuple[str, type]:
        """
        Return under which full name, and as which type, a topic is subscribed to.

        Compressed images lie beside the images, as image_transport puts them: beside what the
        image is remapped to, unless the compressed topic itself is remapped.
        """
        name = input_topic(self._node, topic)
        if not self._is_compressed or topic not in (LEFT, RIGHT):
            return name, TYPES[topic]
        beside = topic + COMPRESSED
        remapped = self._node.resolve_topic_name(beside)
        is_remapped = remapped != self._node.resolve_topic_name(beside, only_expand=True)
        return remapped if is_remapped else name + COMPRESSED, CompressedImage

    def _choose_transport(self, is_compressed: bool) -> None:
        """Let go of images that come the other way; `listen` subscribes anew."""
        if is_compressed != self._is_compressed:
            for topic in {LEFT, RIGHT} & self._subscriptions.keys():
                self._node.destroy_subscription(self._subscriptions.pop(topic))
        self._is_compressed = is_compressed

    def _subscribe(self, topic: str) -> Subscription:
        name, kind = self.source(topic)

        def create(events: SubscriptionEventCallbacks | None) -> Subscription:
            profile = QoSProfile(
                depth=qos_profile_sensor_data.depth,
                reliability=qos_profile_sensor_data.reliability)
            return self._node.create_subscription(
                kind, name, lambda message: self._receive(topic, message), profile,
                event_callbacks=events,
                qos_overriding_options=QoSOverridingOptions.with_default_policies())
        try:
            return create(SubscriptionEventCallbacks(
                incompatible_qos=lambda _: self._on_incompatible(topic),
                matched=lambda status: self._matched(topic, status.current_count),
                use_default_callbacks=False))
        except UnsupportedEventTypeError:
            return create(None)

    def _matched(self, topic: str, publishers: int) -> None:
        if publishers > 0 and topic in self.pairing.optional:
            self.pairing.expect(topic, time.monotonic())

    def _receive(self, topic: str, message: Any) -> None:
        if topic == TRUTH:
            self._on_truth(stamp_ns(message.header), message)
            return
        if topic == LEFT_INFO:
            self._newest = replace(self._newest, left=message)
        elif topic == RIGHT_INFO:
            self._newest = replace(self._newest, right=message)
        if topic in self.pairing.topics:
            self._emit(self.pairing.add(
                topic, stamp_ns(message.header), message, time.monotonic()))

    def _emit(self, ready: list[MessageSet]) -> None:
        for found in ready:
            if self._early is not None:
                self._unmatched_before += 1
            self._early = found
            if not self._is_too_early():
                self._hand_on()
        if self._early is not None and not self._is_too_early():
            self._hand_on()
        if self.holds:
            self._on_hold()

    def _is_too_early(self) -> bool:
        """Whether a set had better wait for the first camera_info of both sides."""
        return (self._waits_for_calibration and not self._newest.is_complete
                and time.monotonic() - self._listening_since < FIRST_CALIBRATION_S)

    def _hand_on(self) -> None:
        """Give the waiting set its calibration: of its stamp, else the newest."""
        found, self._early = self._early, None
        if found is not None:
            self._on_messages(found, Calibration(
                found.messages.get(LEFT_INFO, self._newest.left),
                found.messages.get(RIGHT_INFO, self._newest.right)))

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
Helpers of the node tests: the real node in its own process, and a client that talks to it.

Every test process takes a ROS domain of its own; the node process inherits it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import signal
import subprocess
import sys
import tempfile
import time

from builtin_interfaces.msg import Time  # noqa: E402
import cv2  # noqa: E402
import numpy as np  # noqa: E402
from rcl_interfaces.msg import Parameter as ParameterMsg  # noqa: E402
from rcl_interfaces.srv import (  # noqa: E402
    DescribeParameters, GetParameters, SetParameters, SetParametersAtomically)
import rclpy  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rclpy.qos import QoSProfile, ReliabilityPolicy  # noqa: E402
from sensor_msgs.msg import CameraInfo, Image  # noqa: E402
from stereo_msgs.msg import DisparityImage  # noqa: E402

from stereo_refine_ros.messages.images import fill_image  # noqa: E402

TYPES = {'left/image_rect': Image, 'right/image_rect': Image, 'left/camera_info': CameraInfo,
         'right/camera_info': CameraInfo, 'preliminary/disparity': DisparityImage,
         'ground_truth/disparity': DisparityImage}
READY_S = 60.0


def reliable_inputs(prefix: str = '') -> list[str]:
    """Arguments that make every subscription reliable, so that a test loses nothing."""
    return [part for topic in TYPES for part in (
        '-p', f'qos_overrides.{prefix}/{topic}.subscription.reliability:=reliable')]


class NodeProcess:
    """The node as its own process; `log` is what it printed so far."""

    def __init__(self, *ros_args: str, env: dict[str, str] | None = None) -> None:
        self._log = tempfile.NamedTemporaryFile('w+', suffix='.log')
        command = [sys.executable, '-u', '-m', 'stereo_refine_ros.refine_node']
        if ros_args:
            command += ['--ros-args', *ros_args]
        self.process = subprocess.Popen(
            command, stdout=self._log, stderr=subprocess.STDOUT,
            env={**os.environ, **(env or {})}, cwd=Path(__file__).resolve().parents[2])

    @property
    def log(self) -> str:
        return Path(self._log.name).read_text(encoding='utf-8')

    def wait_ready(self) -> None:
        self.wait_log('ready after', READY_S)

    def wait_log(self, text: str, timeout_s: float = 10.0) -> None:
        wait_until(lambda: text in self.log or self.process.poll() is not None, timeout_s,
                   lambda: f'{text!r} in the log:\n{self.log}')
        assert text in self.log, self.log

    def stop(self, *signals: int, timeout_s: float = 10.0) -> int:
        """Send signals (SIGINT by default); return the exit code."""
        for number in signals or (signal.SIGINT,):
            self.process.send_signal(number)
        try:
            return self.process.wait(timeout_s)
        finally:
            if self.process.poll() is None:
                self.process.kill()
                self.process.wait()


@contextmanager
def running_node(*ros_args: str, ready: bool = True, **kwargs) -> Iterator[NodeProcess]:
    """Run the node for a block; it has to end cleanly."""
    node = NodeProcess(*ros_args, **kwargs)
    try:
        if ready:
            node.wait_ready()
        yield node
    finally:
        print(node.log)
        if node.process.poll() is None:
            code = node.stop()
            assert code == 0, f'exit code {code}\n{node.log}'
            assert 'Traceback' not in node.log, node.log


class Client:
    """Publish to the node, collect what it publishes, call its parameter services."""

    def __init__(self, namespace: str = '', node_name: str = 'refine_node') -> None:
        self.context = rclpy.Context()
        self.context.init()
        self.node = rclpy.create_node(
            f'client_{os.getpid()}', namespace=namespace, context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self._target = node_name
        self._publishers = {}
        self.received: dict[str, list] = {}

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()

    def subscribe(self, topic: str, kind: type) -> None:
        messages = self.received.setdefault(topic, [])
        self.node.create_subscription(
            kind, topic, messages.append, QoSProfile(depth=20))

    def publisher(self, topic: str, kind: type | None = None, **profile):
        if topic not in self._publishers:
            profile = {'depth': 10, 'reliability': ReliabilityPolicy.RELIABLE, **profile}
            self._publishers[topic] = self.node.create_publisher(
                kind or TYPES[topic], topic, QoSProfile(**profile))
        return self._publishers[topic]

    def send(self, messages: dict) -> None:
        """Publish messages by topic."""
        for topic, message in messages.items():
            self.publisher(topic).publish(message)

    def connect(self, topics, timeout_s: float = 15.0) -> None:
        """Create publishers and wait until the node subscribes to them."""
        publishers = [self.publisher(topic) for topic in topics]
        self.until(lambda: all(p.get_subscription_count() for p in publishers), timeout_s,
                   lambda: 'subscriptions of ' + ', '.join(
                       p.topic_name for p in publishers if not p.get_subscription_count()))

    def until(self, condition: Callable[[], bool], timeout_s: float = 15.0,
              what: str | Callable[[], str] = 'condition') -> None:
        end = time.monotonic() + timeout_s
        while not condition():
            if time.monotonic() > end:
                raise AssertionError(f'timed out waiting for {what() if callable(what) else what}')
            self.executor.spin_once(timeout_sec=0.02)

    def spin(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.02)

    def exchange(self, messages: dict, topics=('disparity',), timeout_s: float = 60.0) -> list:
        """Send one set of messages; return what came on each topic with its stamp."""
        first = messages.get('left/camera_info') or messages['left/image_rect']
        stamp = first.header.stamp
        for topic in topics:
            self.received[topic].clear()
        self.send(messages)

        def answers() -> list:
            return [next((m for m in self.received[topic] if header_of(m).stamp == stamp), None)
                    for topic in topics]
        self.until(lambda: None not in answers(), timeout_s, lambda: 'answers on ' + ', '.join(
            topic for topic, found in zip(topics, answers(), strict=True) if found is None))
        return answers()

    def exchange_until(self, make: Callable[[], dict], topics: tuple[str, ...],
                       accepts: Callable[[list], bool]) -> list:
        """
        Send sets, one after another, until the answers to one are accepted, and return those.

        On a busy machine the middleware may lose a part of a set, or bring what nothing waits
        for long, such as truth and calibration, after the pair.
        """
        for _ in range(10):
            try:
                answers = self.exchange(make(), topics, 15.0)
            except AssertionError:
                continue
            if accepts(answers):
                return answers
        raise AssertionError(f'no answer to ten sets on {", ".join(topics)} was right')

    def call(self, kind: type, service: str, request):
        client = self.node.create_client(kind, f'{self._target}/{service}')
        assert client.wait_for_service(15.0), f'no service {service}'
        future = client.call_async(request)
        self.until(future.done, 15.0, service)
        self.node.destroy_client(client)
        return future.result()

    def set(self, **values):  # noqa: A003
        """Set parameters one by one; `__` in a name stands for a dot."""
        return self.call(SetParameters, 'set_parameters',
                         SetParameters.Request(parameters=parameter_messages(values))).results

    def set_atomically(self, **values):
        request = SetParametersAtomically.Request(parameters=parameter_messages(values))
        return self.call(SetParametersAtomically, 'set_parameters_atomically', request).result

    def get(self, *names: str) -> list:
        values = self.call(
            GetParameters, 'get_parameters', GetParameters.Request(names=list(names))).values
        return [Parameter.from_parameter_msg(ParameterMsg(name=name, value=value)).value
                for name, value in zip(names, values, strict=True)]

    def describe(self, *names: str) -> list:
        return self.call(DescribeParameters, 'describe_parameters',
                         DescribeParameters.Request(names=list(names))).descriptors

    def health(self) -> dict[str, float]:
        """Counters of the newest /diagnostics message; waits for one where none has come."""
        self.until(lambda: self.received['/diagnostics'], 10.0, 'diagnostics')
        status = self.received['/diagnostics'][-1].status[0]
        return {item.key: float(item.value) for item in status.values}


def header_of(message):
    """Return the header of a message, for a MarkerArray that of its first marker."""
    return message.header if hasattr(message, 'header') else message.markers[0].header


def parameter_messages(values: dict) -> list[ParameterMsg]:
    return [Parameter(name.replace('__', '.'), value=value).to_parameter_msg()
            for name, value in values.items()]


def wait_until(condition: Callable[[], bool], timeout_s: float, what: Callable[[], str]) -> None:
    end = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > end:
            raise AssertionError(f'timed out waiting for {what()}')
        time.sleep(0.02)


def textured_pair(width: int = 160, height: int = 96, disparity: int = 6, color: bool = True):
    """Give a blurred noise image and its copy shifted by a whole number of pixels."""
    rng = np.random.default_rng(7)
    shape = (height, width + disparity, 3) if color else (height, width + disparity)
    wide = cv2.blur(rng.integers(0, 256, shape, np.uint8), (3, 3))
    wide = cv2.normalize(wide, None, 0, 255, cv2.NORM_MINMAX)
    return wide[:, :width].copy(), wide[:, disparity:].copy()


def image_message(pixels: np.ndarray, encoding: str, stamp: int, frame_id: str = 'left_optical'
                  ) -> Image:
    message = fill_image(Image(), pixels, encoding)
    message.header.stamp = stamp_of(stamp)
    message.header.frame_id = frame_id
    return message


def stamp_of(nanoseconds: int) -> Time:
    return Time(sec=nanoseconds // 10 ** 9, nanosec=nanoseconds % 10 ** 9)


def camera_info(width: int, height: int, stamp: int, focal: float = 200.0, cx: float = 80.0,
                baseline: float = 0.0, frame_id: str = 'left_optical') -> CameraInfo:
    info = CameraInfo(width=width, height=height)
    info.header.stamp, info.header.frame_id = stamp_of(stamp), frame_id
    cy = height / 2.0
    info.k = [focal, 0.0, cx, 0.0, focal, cy, 0.0, 0.0, 1.0]
    info.p = [focal, 0.0, cx, -focal * baseline, 0.0, focal, cy, 0.0, 0.0, 0.0, 1.0, 0.0]
    return info


def stereo_messages(left: np.ndarray, right: np.ndarray, stamp: int, focal: float = 200.0,
                    baseline: float = 0.1, cx_left: float = 80.0, cx_right: float = 80.0) -> dict:
    """Give the four messages of a pair."""
    height, width = left.shape[:2]
    encoding = 'bgr8' if left.ndim == 3 else 'mono8'
    return {
        'left/image_rect': image_message(left, encoding, stamp),
        'right/image_rect': image_message(right, encoding, stamp),
        'left/camera_info': camera_info(width, height, stamp, focal, cx_left),
        'right/camera_info': camera_info(width, height, stamp, focal, cx_right, baseline)}


def floats(message: Image) -> np.ndarray:
    """Return the pixels of a 32FC1 image."""
    assert message.encoding == '32FC1' and message.step == 4 * message.width
    return np.frombuffer(message.data, np.float32).reshape(message.height, message.width)

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
`refine_node`: the live node (`ros2 run stereo_refine_ros refine_node`).

SIGINT or SIGTERM, once or many times, at any stage, ends the process cleanly and without a
traceback (`stop.py`).
"""

from __future__ import annotations

import atexit
import os
import sys
from typing import Any

from stereo_refine_ros.stop import Stop

_LAST_RESORT_S = 1.5
_WORKER_S = 0.3


def main(args: list[str] | None = None) -> int:
    """Run the node until a signal comes; return the exit code if it cannot start."""
    stop = Stop(_LAST_RESORT_S)
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    from stereo_refine_ros.memory import keep_freed_memory
    from stereo_refine_ros.node.parameters import BadParameters
    from stereo_refine_ros.node.refine_node import RefineNode
    from stereo_refine_ros.shared_memory import fit_to_host
    if not stop.may_open():
        return 0
    keep_freed_memory()
    fit_to_host(rclpy.logging.get_logger('refine_node').warning)
    rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = RefineNode()
    except BadParameters:  # the node has said why, under its own name
        rclpy.try_shutdown()
        return 1
    except Exception as error:  # for example QoS overrides that cannot be used
        rclpy.logging.get_logger('refine_node').fatal(f'{type(error).__name__}: {error}')
        rclpy.try_shutdown()
        return 1
    _share_threads_with_opencv(node)
    _spin(node, stop)
    node.stop(_WORKER_S)
    node.destroy_node()
    del node
    rclpy.try_shutdown()
    _leave()
    return 0


def _share_threads_with_opencv(node: Any) -> None:
    """Give OpenCV, whose threads are the whole process's, as many as the kernels have."""
    import cv2

    def follow(_: Any = None) -> None:
        cv2.setNumThreads(node.get_parameter('processing.threads').value)

    follow()
    node.add_post_set_parameters_callback(follow)


def _spin(node: Any, stop: Stop) -> None:
    """Serve callbacks until a signal comes; what the middleware raises is logged, no more."""
    from rclpy.executors import SingleThreadedExecutor
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    # `wake` alone leaves spin_once waiting.
    stop.on_request = lambda: executor.create_task(lambda: None)
    while not stop.requested.is_set():
        try:
            executor.spin_once()
        except Exception as error:  # for example a string in a message that is not UTF-8
            node.get_logger().warning(
                f'message dropped: {type(error).__name__}: {error}', throttle_duration_sec=10)
    executor.shutdown(timeout_sec=0.1)
    stop.on_request = None


def _leave() -> None:
    """
    Close the middleware, then end without waiting for a kernel that may still run.

    The interpreter's own way out takes up to a second more, for unloading LLVM.
    """
    import gc

    import rclpy
    gc.collect()  # what still refers to the context would keep its shared memory
    rclpy.get_default_context().destroy()
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)


if __name__ == '__main__':
    sys.exit(main())

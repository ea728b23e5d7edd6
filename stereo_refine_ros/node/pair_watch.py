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

"""What the node sees of its cameras, frame after frame, and the advice that follows."""

from __future__ import annotations

from sensor_msgs.msg import Image

from stereo_refine_ros.health_advice import Advice, advise, Observation, Settled
from stereo_refine_ros.node.views import RefinedFrame


class PairWatch:
    """Look at every frame in order; say what has been wrong for a while."""

    def __init__(self) -> None:
        """Start without a frame."""
        self._settled = Settled()
        self._left: Image | None = None
        self._right: Image | None = None

    def look(self, refined: RefinedFrame) -> list[Advice]:
        """Take the next frame; return what is wrong, the worst first."""
        frame, result = refined.frame, refined.result
        info = frame.calibration.left
        seen = Observation(
            result.health, result.lr_consistent_ratio, self._frozen(frame.left, frame.right),
            info is not None and any(info.d) and not frame.is_raw,
            refined.decoded.preliminary is not None, refined.params.rectification.correct)
        return self._settled.add(advise(seen))

    def _frozen(self, left: Image, right: Image | None) -> str:
        """Name the image that has not changed while the other one did."""
        before = self._left, self._right
        self._left, self._right = left, right
        if before[0] is None or before[1] is None or right is None:
            return ''
        stays = [new.data == old.data for new, old in zip((left, right), before, strict=True)]
        return {(True, False): 'left', (False, True): 'right'}.get((stays[0], stays[1]), '')

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

"""Write one scene's row of pictures: views, disparity and error before and after, segments."""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np
from stereo_refine_ros.datasets import load_scene
from stereo_refine_ros.evaluation.report import outcome_pictures
from stereo_refine_ros.evaluation.runner import evaluate_scene, Plan
from stereo_refine_ros.types import Image

CAPTION = 34  # px
GAP = 6  # px


def labelled(name: str, picture: Image) -> Image:
    """Put a caption under a picture."""
    strip = np.full((CAPTION, picture.shape[1], 3), 255, np.uint8)
    cv2.putText(strip, name, (2, 24), cv2.FONT_HERSHEY_SIMPLEX, 0.7, (0, 0, 0), 1, cv2.LINE_AA)
    framed = np.vstack([picture, strip])
    return np.pad(framed, ((0, 0), (0, GAP), (0, 0)), constant_values=255)


def main() -> None:
    """Run one combination and write its pictures side by side."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('output', type=Path)
    parser.add_argument('--data', type=Path)
    parser.add_argument('--scene', default='teddy')
    parser.add_argument('--preset', default='paper')
    parser.add_argument('--matching', default='non_local')
    parser.add_argument('--filter', default='weighted_median')
    parser.add_argument('--projection', default='guarded')
    args = parser.parse_args()
    plan = Plan(args.preset, matchings=[args.matching], filters=[args.filter],
                projections=[args.projection], repeat=1)
    outcome = next(evaluate_scene(load_scene(args.scene, args.data), plan))
    pictures = outcome_pictures(outcome, with_scene=True)
    cv2.imwrite(str(args.output), np.hstack(
        [labelled(name, picture) for name, picture in pictures.items()]))


if __name__ == '__main__':
    main()

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

"""Where the refinement of a field scene mended, and where it spoilt."""

from __future__ import annotations

from field_scenes import FieldScene, fill_along_rows, THRESHOLDS
import numpy as np
from stereo_refine_ros.evaluation.pictures import color_disparity
from stereo_refine_ros.images import to_bgr, to_grey
from stereo_refine_ros.types import Image, RefinementResult

# BGR: became right, became wrong, wrong before and after.
MENDED, SPOILT, WRONG = (80, 200, 80), (60, 60, 230), (60, 200, 230)


def draw_changes(scene: FieldScene, result: RefinementResult) -> Image:
    """
    Draw the left view, green where wrong pixels became right, red where right ones became wrong.

    Yellow is wrong in both. To the right of it the map that was given, holes filled from the
    background, and what became of it. Returns uint8 (H, 3 W, 3) BGR.
    """
    given = fill_along_rows(result.preliminary.values)
    maps = given, result.disparity.values
    limit = THRESHOLDS[scene.group]
    before, after = (np.abs(values - scene.truth) > limit for values in maps)
    picture = to_bgr(to_grey(scene.left)) // 2
    for mask, color in ((before & ~after, MENDED), (after & ~before, SPOILT),
                        (before & after, WRONG)):
        picture[mask] = color
    span = result.disparity.min_disparity, float(np.nanmax(scene.truth))
    return np.hstack([picture, *(color_disparity(values, *span) for values in maps)])

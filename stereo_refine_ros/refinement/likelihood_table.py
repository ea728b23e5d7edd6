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

"""Coefficients of the likelihood: made by scripts/fit_likelihood.py."""

PAIR = (
    -1.4255,  # bias
    2.1512,  # vote
    0.1071,  # around
    1.1017,  # plane_near
    -0.5906,  # plane_far
    -0.5152,  # given_far
    -0.3519,  # smooth_given
    0.2387,  # smooth_ungiven
    1.1013,  # fine_near
    -0.6339,  # coarse_far
    0.6046,  # uniqueness
    -0.5958,  # bend
    -0.4933,  # transparent
    0.0442,  # unseen
    -0.0714,  # hole
    1.0030,  # hole_vote
    -0.7364,  # hole_plane
    0.4594,  # hole_behind
    -0.3183,  # border
    0.6775,  # border_plane
    0.0897,  # border_behind
    0.6761,  # uniqueness_around
    0.2271,  # disagreement_around
    0.8048,  # slant
    -0.4754,  # misfit
)

ALONE = (
    -0.7708,  # bias
    2.5179,  # vote
    1.5096,  # around
    2.0893,  # plane_near
    -0.4954,  # plane_far
    -0.2569,  # given_far
    -0.2334,  # smooth_given
    0.2738,  # smooth_ungiven
    1.5630,  # fine_near
    0.0000,  # coarse_far
    0.0000,  # uniqueness
    -0.7498,  # bend
    0.0000,  # transparent
    -1.0180,  # unseen
    1.3616,  # hole
    -0.0411,  # hole_vote
    -1.2822,  # hole_plane
    0.4970,  # hole_behind
    0.5360,  # border
    0.6761,  # border_plane
    -0.2900,  # border_behind
    0.0000,  # uniqueness_around
    -0.7708,  # disagreement_around
    0.3603,  # slant
    -1.0994,  # misfit
)

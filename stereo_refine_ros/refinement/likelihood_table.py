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
    -0.1502,  # bias
    2.5677,  # vote
    0.5097,  # around
    0.9975,  # plane_near
    -0.5746,  # plane_far
    -0.5973,  # given_far
    -0.3503,  # smooth_given
    0.2695,  # smooth_ungiven
    1.3037,  # fine_near
    -0.9086,  # coarse_far
    0.3901,  # uniqueness
    -0.5709,  # bend
    -0.5367,  # transparent
    -0.1944,  # unseen
    -0.1297,  # hole
    1.0927,  # hole_vote
    -0.5862,  # hole_plane
    0.4636,  # hole_behind
    -0.2703,  # border
    0.8879,  # border_plane
    0.0881,  # border_behind
    0.2836,  # uniqueness_around
    -0.4243,  # disagreement_around
    1.0462,  # slant
    -0.4901,  # misfit
)

ALONE = (
    -0.7505,  # bias
    2.5578,  # vote
    1.3587,  # around
    2.1154,  # plane_near
    -0.5873,  # plane_far
    -0.2540,  # given_far
    -0.1785,  # smooth_given
    0.2953,  # smooth_ungiven
    1.5895,  # fine_near
    0.0000,  # coarse_far
    0.0000,  # uniqueness
    -0.7144,  # bend
    0.0000,  # transparent
    -1.0403,  # unseen
    1.3216,  # hole
    -0.1260,  # hole_vote
    -1.3026,  # hole_plane
    0.5686,  # hole_behind
    0.4771,  # border
    0.7411,  # border_plane
    -0.3157,  # border_behind
    0.0000,  # uniqueness_around
    -0.7505,  # disagreement_around
    0.2670,  # slant
    -1.0641,  # misfit
)

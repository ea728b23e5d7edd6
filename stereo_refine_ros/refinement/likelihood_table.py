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
    0.0210,  # bias
    2.6405,  # vote
    0.5395,  # around
    0.9868,  # plane_near
    -0.5666,  # plane_far
    -0.6278,  # given_far
    -0.3532,  # smooth_given
    0.2755,  # smooth_ungiven
    1.3571,  # fine_near
    -0.9407,  # coarse_far
    0.3777,  # uniqueness
    -0.5613,  # bend
    -0.5259,  # transparent
    -0.2421,  # unseen
    -0.1703,  # hole
    1.0720,  # hole_vote
    -0.5227,  # hole_plane
    0.4930,  # hole_behind
    -0.2782,  # border
    0.9906,  # border_plane
    0.0429,  # border_behind
    0.2124,  # uniqueness_around
    -0.4758,  # disagreement_around
    1.0378,  # slant
    -0.5185,  # misfit
)

ALONE = (
    -0.7446,  # bias
    2.5657,  # vote
    1.3047,  # around
    2.1264,  # plane_near
    -0.5954,  # plane_far
    -0.2489,  # given_far
    -0.1708,  # smooth_given
    0.2909,  # smooth_ungiven
    1.6007,  # fine_near
    0.0000,  # coarse_far
    0.0000,  # uniqueness
    -0.6993,  # bend
    0.0000,  # transparent
    -1.0589,  # unseen
    1.2932,  # hole
    -0.1249,  # hole_vote
    -1.2842,  # hole_plane
    0.5849,  # hole_behind
    0.4592,  # border
    0.8230,  # border_plane
    -0.3368,  # border_behind
    0.0000,  # uniqueness_around
    -0.7446,  # disagreement_around
    0.2390,  # slant
    -1.0607,  # misfit
)

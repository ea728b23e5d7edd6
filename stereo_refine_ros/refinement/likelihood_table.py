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
    -1.5184,  # bias
    2.1837,  # vote
    0.2085,  # around
    1.6165,  # plane_near
    -0.7611,  # plane_far
    0.5670,  # plane_residual
    -0.5405,  # given_far
    -0.3502,  # smooth_given
    0.3003,  # smooth_ungiven
    1.0025,  # fine_near
    -0.6201,  # coarse_far
    0.5856,  # uniqueness
    -0.6391,  # bend
    0.0067,  # step
    -0.5070,  # transparent
    0.2130,  # unseen
    -0.0384,  # hole
    0.9038,  # hole_vote
    -0.2578,  # hole_plane
    0.3939,  # uniqueness_around
    0.0830,  # disagreement_around
)

ALONE = (
    -1.1854,  # bias
    2.1812,  # vote
    0.9388,  # around
    2.9333,  # plane_near
    -0.9329,  # plane_far
    0.8569,  # plane_residual
    -0.2641,  # given_far
    -0.2896,  # smooth_given
    0.3014,  # smooth_ungiven
    1.5742,  # fine_near
    0.0000,  # coarse_far
    0.0000,  # uniqueness
    -0.5432,  # bend
    -0.4478,  # step
    0.0000,  # transparent
    -0.5205,  # unseen
    1.5831,  # hole
    -0.0409,  # hole_vote
    -1.2143,  # hole_plane
    0.0000,  # uniqueness_around
    -1.1854,  # disagreement_around
)

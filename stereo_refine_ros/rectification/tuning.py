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
The constants of this folder: unit, effect.

Measured on the lab and field scenes by `python benchmarks/camera_faults.py` and held by
test/rectification/test_real_row_offset.py.
"""

# Half-size levels until the coarse one is no wider than this, pixels. Wider: finer start, slower.
COARSE_WIDTH_PX = 200
# The image is cut into this many columns and rows of cells; the best corner of each is matched.
CELLS_ACROSS, CELLS_DOWN = 20, 15
# Half a side of the blocks: coarse pixels, and pixels of the level that is refined.
COARSE_RADIUS_PX, FINE_RADIUS_PX = 3, 8
# Rows searched above and below, coarse pixels (four image pixels each at 640x480).
COARSE_ROWS_PX = 2
# Below this correlation a point is not believed: coarse search, and after refinement.
COARSE_CORRELATION, FINE_CORRELATION = 0.7, 0.8
# Gauss-Newton steps at each level, and a step after which no further one is needed, pixels; a
# point that moved further than the reach was a wrong start.
FINE_STEPS, FINE_STEP_PX, FINE_REACH_PX = 5, 0.03, 3.0
# The fit forgives residuals beyond these, one step after the other, pixels.
FIT_SCALES_PX = (4.0, 2.0, 1.0, 0.5, 0.4, 0.4)
# What a point lies near the fit within, pixels.
NEAR_PX = 0.8
# No point is believed to better than this, nor all points of a patch together, pixels.
POINT_SIGMA_PX, PATCH_SIGMA_PX = 0.15, 0.15
# The image is cut into so many patches across and down, whose points go together.
PATCHES = 5
# What is expected of the terms without evidence, pixels.
PRIOR_PX = (8.0, 2.0, 2.0, 8.0)
# Fewer points than this near the fit, or a smaller share of all, are no evidence: of an offset,
# and of how it changes over the image.
FEWEST_POINTS, LEAST_SHARE = 30, 0.35
FEWEST_FOR_SLOPES, LEAST_SHARE_FOR_SLOPES = 60, 0.65
# A term counts from so many standard errors and from this effect at the border, pixels.
TERM_ERRORS, TERM_PX = 3.5, 0.15
# An offset below this at its largest is none, pixels.
LEAST_PX = 0.2
# Frames whose measurements are averaged, and frames in a row that make a knock.
FRAMES_AVERAGED, FRAMES_TO_FOLLOW = 15, 3
# A knock moves the offset by this; less than the other changes nothing of what is in use, pixels.
KNOCK_PX, KEEP_PX = 0.4, 0.12
# A tilt below the first is not taken for a turn of the camera, one above the second is, degrees.
SLIGHT_TURN_DEG, CLEAR_TURN_DEG = 0.06, 0.15

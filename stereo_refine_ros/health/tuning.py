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

Measured on the lab and field scenes; held by test/health/test_real_pairs.py.
"""

# Every so many rows and columns are looked at for levels and sharpness.
EVERY_ROW, EVERY_COLUMN = 4, 2
# Side of the blocks that noise is measured in, pixels, and the distance of their corners.
NOISE_BLOCK_PX, NOISE_EVERY_PX = 8, 16
# The noise is that of the plainest blocks: this share of them is plainer still.
NOISE_QUANTILE = 0.1
# What that quantile of pure noise is of its standard deviation (without the texture, 8x8 pixels).
NOISE_QUANTILE_OF_SIGMA = 0.84
# Grey levels at the ends of the scale that count as black and white.
BLACK, WHITE = 1, 254
# A view of less contrast than this, grey levels, shows nothing: two such views are not compared.
PLAIN = 1.0
# The coarse look is taken at about this width, pixels.
COARSE_WIDTH_PX = 160
# Side of the blocks that are matched then, coarse pixels.
COARSE_BLOCK_PX = 11
# Within how many pixels an external map agrees with the own match.
AGREE_PX = 2.0
# An external map is of the other view where its error there is below this share of that here.
CLEARLY_BETTER = 0.85
# Gradient, grey levels a pixel, from which a pixel says where the map's view is.
EDGE = 8.0
# Gaussian by which the views are smoothed for that, pixels.
EDGE_BLUR_PX = 1.0

# Coarse look and whose view an external map is of, seconds: so seldom they are asked, since they
# take as long as a frame's planes.
LOOK_EVERY_S = 1.0
# Row offset, pairs: once it has settled it is measured on one pair of so many; a camera that is
# knocked is followed that much later.
LOOK_EVERY_PAIRS = 3
# Noise, ratio to the contrast of the dimmer view: from here on a pair is cleared before it is
# matched. Healthy pairs 0.02 to 0.04, noise of 5 grey levels 0.07, a dark pair 0.15.
CLEAR_NOISE = 0.06
# ... by a Gaussian of so many pixels: bad-1 of five preliminary maps at noise 5, 10 and dark:
# none 18.8, 28.5, 28.1; 0.7 17.7, 24.1, 24.7; 1.0 18.4, 24.4, 25.5.
CLEAR_BLUR_PX = 0.7
# ... and stretched to a contrast of so many grey levels, by at most a factor of so much.
CLEAR_CONTRAST, CLEAR_GAIN = 40.0, 8.0
# Exposure, ratio of the contrasts of both views in one channel: from the first on the right view
# is made like the left one, from the second on the two are not of one scene.
EXPOSURES = 1.12, 2.5

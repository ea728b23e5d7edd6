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
Tuning of the graph stage: what each constant is measured in, does, and rests on.

"Not measured separately": kept as it was when the whole was last measured, by
`python benchmarks/accuracy.py`.
"""

# Segment tree, grey levels x pixels: a segment of n pixels grows over edges of up to this / n
# above its own heaviest. Larger: fewer, larger segments. Mei et al. 2013.
SEGMENT_SCALE = 1200.0
# Segment tree, pixels: only links between two segments larger than this are made heavier. Mei et
# al. 2013.
LARGE_SEGMENT = 50
# Segment tree, grey levels: how much heavier. Larger: less support across segments. Mei et al.
# 2013.
LINK_PENALTY = 5
# Sweeps, ratio: what is left of a vote after one step over a flat image. Larger: votes reach
# farther. Not measured separately.
FADE = 0.9
# Levels, pixels of disparity: between neighbours of the half-size grid that differ by more is a
# step, not a slant. Not measured separately.
SMOOTH_STEP = 2.0

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

"""Time and memory of one large pair: noise, the worst there is for segments, at one disparity."""

from __future__ import annotations

import argparse
import resource
import time

import numpy as np
from stereo_refine_ros.memory import keep_freed_memory
from stereo_refine_ros.params import load_preset, PRESETS
from stereo_refine_ros.pipeline import StereoRefiner


def main() -> None:
    """Compile on a corner of the pair, refine the whole, and print what it took."""
    keep_freed_memory()
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--preset', default='live', choices=PRESETS)
    parser.add_argument('--size', default='4096x3072x64', help='width x height x disparities')
    options = parser.parse_args()
    width, height, disparities = map(int, options.size.split('x'))
    left = np.random.default_rng(0).integers(0, 256, (height, width, 3), dtype=np.uint8)
    pair = left, np.roll(left, -disparities // 3, axis=1)
    refiner = StereoRefiner(load_preset(
        options.preset, {'matching.num_disparities': disparities}))
    refiner.process(*(view[:height // 4, :width // 4] for view in pair))
    begin = time.perf_counter()
    result = refiner.process(*pair)
    seconds = time.perf_counter() - begin
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    valid = np.isfinite(result.disparity.values).mean()
    print(f'{options.preset} {options.size}: {seconds:.1f} s, peak {peak:.0f} MB, '
          f'{len(result.segments.planes):,} segments, {100 * valid:.0f} % valid')


if __name__ == '__main__':
    main()

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

"""`evaluate` on a scene whose truth is a PNG of 16 bits."""

import json

from real_scenes import real_scene_folder

from stereo_refine_ros.evaluate import main


def test_kitti_truth_is_measured_in_pixels(tmp_path, capsys):
    folder = real_scene_folder('../field/kitti2012')
    code = main(['--data', str(folder), '--scenes', '000000_10', '--repeat', '1',
                 '--json', str(tmp_path / 'rows.json')])
    assert (code, capsys.readouterr().err.count('Traceback')) == (0, 0)
    rows = json.loads((tmp_path / 'rows.json').read_text())
    assert [row['stage'] for row in rows] == ['preliminary', 'before', 'after']
    assert all(5 < row['bad_1_0'] < 30 and row['bad_2_0'] < 12 for row in rows)
    # 8-bit levels of 80 disparities, not the 256 levels per pixel of the file
    assert all(row['mse'] < 1000 and row['psnr'] > 20 for row in rows)

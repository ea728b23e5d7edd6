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

"""Stereo pairs to work on: Middlebury, rendered planes, folders and bags."""

from stereo_refine_ros.datasets.folder import iterate_folder
from stereo_refine_ros.datasets.locate import cache_dir, find_data
from stereo_refine_ros.datasets.middlebury import list_scenes, load_scene
from stereo_refine_ros.datasets.scene import Scene
from stereo_refine_ros.datasets.synthetic import render_scene, SyntheticScene

__all__ = ['Scene', 'SyntheticScene', 'cache_dir', 'find_data', 'iterate_folder', 'list_scenes',
           'load_scene', 'render_scene']

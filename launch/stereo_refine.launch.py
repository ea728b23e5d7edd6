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
Start the live node for one camera.

ros2 launch stereo_refine_ros stereo_refine.launch.py left:=/zed/left right:=/zed/right

Another argument may be image:=image_rect_color, or preset:=accurate; -s shows them all.
"""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, SetEnvironmentVariable
from launch.conditions import IfCondition
from launch.substitutions import EnvironmentVariable, LaunchConfiguration
from launch_ros.actions import Node

CONFIG = Path(__file__).parents[1] / 'config'
# Fast DDS reads the first name up to Jazzy and the second one after it.
PROFILE_VARIABLES = ('FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE')

# Name: default value, meaning.
ARGUMENTS = {
    'namespace': ('', 'namespace of the node and its topics'),
    'name': ('refine_node', 'name of the node'),
    'left': ('left', 'namespace of the left camera: topics <left>/<image>, <left>/camera_info'),
    'right': ('right', 'namespace of the right camera'),
    'image': ('image_rect', 'name of the image topics in both, for example image_rect_color'),
    'left_image': ('', 'left image topic, where <left>/<image> is not its name'),
    'right_image': ('', 'right image topic, where <right>/<image> is not its name'),
    'left_camera_info': ('', 'left camera_info topic, where it is not beside the left image'),
    'right_camera_info': ('', 'right camera_info topic, where it is not beside the right image'),
    'preliminary': ('preliminary/disparity', 'disparity to refine, with method:=external'),
    'disparity': ('disparity', 'refined disparity'),
    'preset': ('', 'live, accurate or paper; empty: that of params_file'),
    'method': ('', 'matching.method: sgbm, bm, segment_tree, non_local, scanline or external; '
                   'empty: that of the preset'),
    'num_disparities': ('', 'matching.num_disparities, px; empty: that of the preset'),
    'params_file': ('', 'your own ROS parameter file; empty: config/<preset>.yaml'),
    'use_sim_time': ('false', 'time from /clock, for bags'),
    'shared_memory': ('true', 'Fast DDS shared memory large enough for images; the camera driver '
                              'needs the same profile, and a profile set already stays'),
}


def remappings(chosen):
    """Pair each input and the output with the topic that was chosen for it."""
    pairs = [('preliminary/disparity', chosen['preliminary']),
             ('disparity', chosen['disparity'])]
    for side in 'left', 'right':
        image = chosen[f'{side}_image'] or f"{chosen[side].rstrip('/')}/{chosen['image']}"
        info = chosen[f'{side}_camera_info'] or beside(image)
        pairs += [(f'{side}/image_rect', image), (f'{side}/camera_info', info)]
    return pairs


def beside(image):
    """Name the camera_info of an image topic, as image_transport does."""
    namespace, slash, _ = image.rpartition('/')
    return f'{namespace}{slash}camera_info'


def parameters(chosen):
    """Give the parameter file, and what the command line says over it."""
    preset, method = chosen['preset'], chosen['method']
    file = chosen['params_file'] or str(CONFIG / f"{preset or 'live'}.yaml")
    values = {'use_sim_time': is_true(chosen['use_sim_time'])}
    if preset:
        values['preset'] = preset
    if method:
        values['matching.method'] = method
    if chosen['num_disparities']:
        values['matching.num_disparities'] = whole(chosen['num_disparities'])
    return [file, values]


def is_true(text):
    """Read a switch as launch does."""
    if text.lower() not in ('true', '1', 'false', '0'):
        raise ValueError(f'use_sim_time:={text}: expected true or false')
    return text.lower() in ('true', '1')


def whole(text):
    """Read a number of disparities."""
    if not text.isdecimal():
        raise ValueError(f'num_disparities:={text}: expected a whole number of pixels')
    return int(text)


def node(context):
    """Start the node as the arguments say."""
    chosen = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    return [Node(
        package='stereo_refine_ros', executable='refine_node', output='screen',
        name=chosen['name'], namespace=chosen['namespace'],
        parameters=parameters(chosen), remappings=remappings(chosen))]


def profile():
    """Point Fast DDS at the profile with large shared-memory segments."""
    return [
        SetEnvironmentVariable(
            name, EnvironmentVariable(name, default_value=str(CONFIG / 'fastdds_shm.xml')),
            condition=IfCondition(LaunchConfiguration('shared_memory')))
        for name in PROFILE_VARIABLES]


def generate_launch_description():
    """Describe the launch."""
    declared = [DeclareLaunchArgument(name, default_value=default, description=meaning)
                for name, (default, meaning) in ARGUMENTS.items()]
    return LaunchDescription([*declared, *profile(), OpaqueFunction(function=node)])

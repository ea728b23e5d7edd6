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
Start a node for each of two stereo cameras, in namespaces of their own.

Each takes <namespace>/left/image_rect and so on, and publishes <namespace>/disparity:

ros2 launch stereo_refine_ros two_cameras.launch.py first:=front second:=rear
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, GroupAction, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.substitutions import FindPackageShare

SHARE = FindPackageShare('stereo_refine_ros')
CAMERAS = {'first': 'front', 'second': 'rear'}


def arguments():
    """Declare a namespace and a parameter file for each camera."""
    declared = []
    for camera, namespace in CAMERAS.items():
        declared += [
            DeclareLaunchArgument(
                camera, default_value=namespace, description=f'namespace of the {camera} camera'),
            DeclareLaunchArgument(
                f'{camera}_params_file',
                default_value=PathJoinSubstitution([SHARE, 'config', 'live.yaml']),
                description=f'ROS parameter file of the {camera} camera'),
        ]
    return declared


def camera_node(camera):
    """Include the launch file of one camera, its arguments kept to itself."""
    source = PythonLaunchDescriptionSource(
        PathJoinSubstitution([SHARE, 'launch', 'stereo_refine.launch.py']))
    return GroupAction([IncludeLaunchDescription(source, launch_arguments={
        'namespace': LaunchConfiguration(camera),
        'params_file': LaunchConfiguration(f'{camera}_params_file'),
    }.items())])


def generate_launch_description():
    """Describe the launch."""
    return LaunchDescription([*arguments(), *(camera_node(camera) for camera in CAMERAS)])

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

ros2 launch stereo_refine_ros stereo_refine.launch.py namespace:=front left:=cam0 right:=cam1
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, SetEnvironmentVariable
from launch.conditions import IfCondition
from launch.substitutions import EnvironmentVariable, LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

# Fast DDS reads the first name up to Jazzy and the second one after it.
PROFILE_VARIABLES = ('FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE')


def config(name):
    """Name a file of the installed `config` folder."""
    return PathJoinSubstitution([FindPackageShare('stereo_refine_ros'), 'config', name])


def arguments():
    """Declare what can be chosen on the command line."""
    return [
        DeclareLaunchArgument(
            'namespace', default_value='', description='namespace of the node and its topics'),
        DeclareLaunchArgument(
            'name', default_value='refine_node', description='name of the node'),
        DeclareLaunchArgument(
            'left', default_value='left', description='topics <left>/image_rect, camera_info'),
        DeclareLaunchArgument(
            'right', default_value='right', description='topics <right>/image_rect, camera_info'),
        DeclareLaunchArgument(
            'preliminary', default_value='preliminary/disparity',
            description='disparity to refine, where matching.method is external'),
        DeclareLaunchArgument(
            'disparity', default_value='disparity', description='refined disparity'),
        DeclareLaunchArgument(
            'params_file', default_value=config('live.yaml'),
            description='ROS parameter file: one of config/*.yaml or your own'),
        DeclareLaunchArgument(
            'use_sim_time', default_value='false', description='time from /clock, for bags'),
        DeclareLaunchArgument(
            'shared_memory', default_value='true',
            description='Fast DDS shared memory large enough for images; the camera driver '
                        'needs the same profile, and a profile set already stays'),
    ]


def profile():
    """Point Fast DDS at the profile with large shared-memory segments."""
    return [
        SetEnvironmentVariable(
            name, EnvironmentVariable(name, default_value=config('fastdds_shm.xml')),
            condition=IfCondition(LaunchConfiguration('shared_memory')))
        for name in PROFILE_VARIABLES]


def node():
    """Start the node with its topics renamed."""
    left, right = LaunchConfiguration('left'), LaunchConfiguration('right')
    return Node(
        package='stereo_refine_ros', executable='refine_node', output='screen',
        name=LaunchConfiguration('name'), namespace=LaunchConfiguration('namespace'),
        parameters=[LaunchConfiguration('params_file'),
                    {'use_sim_time': LaunchConfiguration('use_sim_time')}],
        remappings=[
            ('left/image_rect', [left, '/image_rect']),
            ('left/camera_info', [left, '/camera_info']),
            ('right/image_rect', [right, '/image_rect']),
            ('right/camera_info', [right, '/camera_info']),
            ('preliminary/disparity', LaunchConfiguration('preliminary')),
            ('disparity', LaunchConfiguration('disparity')),
        ])


def generate_launch_description():
    """Describe the launch."""
    return LaunchDescription([*arguments(), *profile(), node()])

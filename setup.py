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

"""Build and install; the name, version and maintainer come from package.xml."""

from importlib.machinery import PathFinder
from pathlib import Path
import site
import sys
from xml.etree import ElementTree

from setuptools import find_packages, setup

HERE = Path(__file__).parent
MANIFEST = ElementTree.parse(HERE / 'package.xml').getroot()
NAME = 'stereo_refine_ros'


def _manifest(tag: str) -> str:
    return ' '.join((MANIFEST.findtext(tag) or '').split())


def _files(*patterns: str) -> list[str]:
    return sorted(
        str(path.relative_to(HERE)) for pattern in patterns for path in HERE.glob(pattern))


def _opencv() -> list[str]:
    """
    Name OpenCV where there is none; what the user has is kept.

    It comes by apt and as four pip packages that overwrite one another, and the newest asks for
    numpy 2. Looked for where pip will install, which is not what its isolated build can import.
    """
    folders = site.getsitepackages()
    if sys.prefix == sys.base_prefix:
        folders.append(site.getusersitepackages())
    return [] if PathFinder.find_spec('cv2', folders) else ['opencv-python-headless>=4.6']


setup(
    name=NAME,
    version=_manifest('version'),
    description=_manifest('description'),
    author=_manifest('author'),
    url=_manifest('url'),
    maintainer=_manifest('maintainer'),
    maintainer_email=MANIFEST.find('maintainer').attrib['email'],
    license=_manifest('license'),
    packages=find_packages(include=[NAME, NAME + '.*']),
    package_data={NAME: ['py.typed']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + NAME]),
        ('share/' + NAME, ['package.xml']),
        ('share/' + NAME + '/config', _files('config/*.yaml', 'config/*.xml', 'config/*.rviz')),
        ('share/' + NAME + '/launch', _files('launch/*.launch.py')),
    ],
    python_requires='>=3.10',
    # No ROS package here: apt's ROS has no pip names (a pip-only machine: requirements/ros.txt).
    install_requires=['setuptools', 'numpy>=1.26', *_opencv(), 'numba', 'pyyaml'],
    extras_require={
        'bag': ['rosbags'],
        'demo': ['rich'],
        'test': ['hypothesis', 'matplotlib', 'psutil', 'pytest', 'rich', 'rosbags',
                 'scikit-image'],
    },
    zip_safe=False,
    entry_points={
        'console_scripts': [
            'refine_node = stereo_refine_ros.refine_node:main',
            'replay = stereo_refine_ros.replay.__main__:main',
            'evaluate = stereo_refine_ros.evaluate:main',
        ],
    },
)

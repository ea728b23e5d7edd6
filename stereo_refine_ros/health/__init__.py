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

"""What a pair of images says of the cameras that took it."""

from stereo_refine_ros.health.external import fits_right_better, given_agreement
from stereo_refine_ros.health.suspicion import CoarseLook, suspect
from stereo_refine_ros.health.views import measure_views, noise_sigma

__all__ = [
    'CoarseLook', 'fits_right_better', 'given_agreement', 'measure_views', 'noise_sigma',
    'suspect']

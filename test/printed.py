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

"""What a process of ours printed, without what its middleware put between."""

COLOUR = '\x1b['  # every line that Fast DDS logs begins with one; none of ours does


def own_lines(printed: str) -> str:
    """
    Leave out the lines of Fast DDS, which logs to standard output.

    It says there, for example, that another process held a port of the shared memory (one
    folder for all domains) and that it took the next one.
    """
    return ''.join(line for line in printed.splitlines(keepends=True)
                   if not line.startswith(COLOUR))

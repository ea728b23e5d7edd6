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

"""What the tests of health share."""

from types import SimpleNamespace

import pytest

from stereo_refine_ros.health import long_look


@pytest.fixture
def asked(monkeypatch):
    """Log what pairs are asked, at a time that stands still; every answer is another."""
    log = SimpleNamespace(now=100.0, questions=[], views=[])
    monkeypatch.setattr(long_look, 'time', SimpleNamespace(monotonic=lambda: log.now))

    def look_at(question, left, right, *_):
        log.questions.append(question)
        log.views.append((left, right))
        return float(len(log.questions))
    monkeypatch.setattr(long_look, 'look_at', look_at)
    monkeypatch.setattr(long_look, 'fits_right_better',
                        lambda *_: log.questions.append('fits right') or True)
    return log

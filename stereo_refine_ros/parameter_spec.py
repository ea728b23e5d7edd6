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

"""How a parameter is defined: fields with a range, a unit and a description; their check."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields, is_dataclass
import math
from typing import Any


def choice(default: str, choices: tuple[str, ...], description: str) -> Any:
    """Define a parameter that is one of a few words."""
    return field(default=default, metadata={'choices': choices, 'description': description})


def integer(default: int, low: int, high: int, unit: str, description: str) -> Any:
    """Define a whole number within limits."""
    meta = {'low': low, 'high': high, 'unit': unit, 'description': description}
    return field(default=default, metadata=meta)


def number(default: float, low: float, high: float, unit: str, description: str) -> Any:
    """Define a number within limits."""
    meta = {'low': low, 'high': high, 'unit': unit, 'description': description}
    return field(default=default, metadata=meta)


def flag(default: bool, description: str) -> Any:
    """Define a switch."""
    return field(default=default, metadata={'description': description})


@dataclass(frozen=True)
class ParameterSpec:
    """The definition of one parameter, as the ROS descriptors and docs/ need it."""

    name: str
    type: type  # noqa: A003
    default: Any
    description: str
    unit: str = ''
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()

    def check(self, value: Any) -> Any:
        """Return `value` as the parameter's type; raise ValueError saying what is allowed."""
        if self.type is float and type(value) is int:
            value = float(value)
        if value is False and 'off' in self.choices:
            value = 'off'  # as YAML 1.1 reads the word
        given = type(value)
        if given is not self.type:
            raise ValueError(
                f'{self.name}: expected {self.type.__name__}, got {given.__name__} {value!r}')
        if self.choices and value not in self.choices:
            raise ValueError(f'{self.name}: {value!r} is none of {", ".join(self.choices)}')
        if self.low is not None and self.high is not None:
            if not math.isfinite(value) or not self.low <= value <= self.high:
                raise ValueError(
                    f'{self.name}: {value} is outside {self.low} to {self.high}')
        return value


def specs_of(node: Any, prefix: str = '') -> Iterator[ParameterSpec]:
    """Define the parameters of a tree of dataclasses, by dotted name."""
    for item in fields(node):
        value = getattr(node, item.name)
        if is_dataclass(value):
            yield from specs_of(value, f'{prefix}{item.name}.')
        else:
            yield ParameterSpec(prefix + item.name, type(value), value, **item.metadata)

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

"""The parameters of `params.py` as ROS parameters: declared, described, changed as a whole."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult)
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.parameter import Parameter

from stereo_refine_ros.params import (
    load_preset, ParameterSpec, Params, PRESETS, SPEC_BY_NAME)


class BadParameters(Exception):
    """The parameters given at start cannot be used; the text says why."""


def describe(spec: ParameterSpec) -> ParameterDescriptor:
    """
    Build the ROS descriptor of a parameter.

    Typed dynamically, so that `1` for a float is taken and a wrong type is refused with a
    reason instead of an exception.
    """
    unit = f' [{spec.unit}]' if spec.unit not in ('', '-') else ''
    descriptor = ParameterDescriptor(
        name=spec.name, description=spec.description + unit, dynamic_typing=True)
    if spec.choices:
        descriptor.additional_constraints = 'one of ' + ', '.join(spec.choices)
    if spec.low is not None and spec.high is not None:
        if spec.type is int:
            descriptor.integer_range = [
                IntegerRange(from_value=int(spec.low), to_value=int(spec.high), step=1)]
        else:
            descriptor.floating_point_range = [
                FloatingPointRange(from_value=spec.low, to_value=spec.high, step=0.0)]
    return descriptor


class NodeParameters:
    """
    Keep one immutable `Params` in step with the node's ROS parameters.

    Parameters
    ----------
    node : rclpy.node.Node
    on_change : callable of (old, new) Params
        Called after a batch was accepted whole.

    Raises
    ------
    BadParameters
        Where the values given at start are refused.

    """

    def __init__(self, node: Node, on_change: Callable[[Params, Params], None]) -> None:
        """Declare every parameter and follow its changes."""
        self._on_change = on_change
        try:
            self.current = self._declare(node)
        except (ValueError, ParameterException) as error:
            raise BadParameters(str(error)) from error
        node.add_pre_set_parameters_callback(self._complete)
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._apply)

    def _declare(self, node: Node) -> Params:
        preset = node.declare_parameter(
            'preset', PRESETS[0], describe(SPEC_BY_NAME['preset'])).value
        params = load_preset(preset)
        given: dict[str, Any] = {}
        for name, default in params.as_dict().items():
            if name != 'preset':
                given[name] = node.declare_parameter(
                    name, default, describe(SPEC_BY_NAME[name])).value
        params = params.updated(given)
        node.set_parameters(
            [Parameter(name, value=value) for name, value in params.as_dict().items()
             if type(value) is not type(given.get(name, value))])
        return params

    def _complete(self, parameters: list[Parameter]) -> list[Parameter]:
        """Give integers the type their float needs; let a new preset bring its values."""
        given = {item.name: item.value for item in parameters}
        complete = [_typed(item) for item in parameters]
        preset = given.get('preset', self.current.preset)
        if preset != self.current.preset and preset in PRESETS:
            complete += [Parameter(name, value=value)
                         for name, value in load_preset(preset).as_dict().items()
                         if name not in given]
        return complete

    def _check(self, parameters: list[Parameter]) -> SetParametersResult:
        try:
            self.current.updated(_ours(parameters))
        except ValueError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply(self, parameters: list[Parameter]) -> None:
        changed = _ours(parameters)
        if changed:
            old, self.current = self.current, self.current.updated(changed)
            self._on_change(old, self.current)


def _typed(parameter: Parameter) -> Parameter:
    spec = SPEC_BY_NAME.get(parameter.name)
    if spec is not None and spec.type is float and type(parameter.value) is int:
        return Parameter(parameter.name, value=float(parameter.value))
    return parameter


def _ours(parameters: list[Parameter]) -> dict[str, Any]:
    return {item.name: item.value for item in parameters if item.name in SPEC_BY_NAME}

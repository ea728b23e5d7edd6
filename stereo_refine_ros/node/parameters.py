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

from stereo_refine_ros.node.parameter_advice import explain, is_foreign
from stereo_refine_ros.params import (
    check_values, load_preset, ParameterSpec, Params, PRESETS, SPEC_BY_NAME)


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

    What was set by name, at start or since, stays when another preset is chosen.

    Parameters
    ----------
    node : rclpy.node.Node
        Made with `automatically_declare_parameters_from_overrides`.
    on_change : callable of (old, new) Params
        Called after a batch was accepted whole.

    Raises
    ------
    BadParameters
        Where the values given at start are refused.

    """

    def __init__(self, node: Node, on_change: Callable[[Params, Params], None]) -> None:
        """Declare every parameter and follow its changes."""
        self._node = node
        self._on_change = on_change
        self._from_preset: set[str] = set()
        given = _take_overrides(node)
        preset = given.pop('preset', PRESETS[0])
        try:
            self.current = load_preset(preset, given)
            self._chosen = check_values(given)
            for name, value in self.current.as_dict().items():
                node.declare_parameter(
                    name, value, describe(SPEC_BY_NAME[name]), ignore_override=True)
        except (ValueError, ParameterException) as error:
            raise BadParameters(str(error)) from error
        node.add_pre_set_parameters_callback(self._complete)
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._apply)

    def _complete(self, parameters: list[Parameter]) -> list[Parameter]:
        """Give values the type of their parameter; let a new preset bring its values."""
        self._from_preset = set()
        complete = [_typed(item) for item in parameters]
        given = {item.name: item.value for item in complete}
        for name in filter(is_foreign, given):
            if not self._node.has_parameter(name):
                self._node.get_logger().warning(explain(name))
        preset = given.get('preset', self.current.preset)
        if preset != self.current.preset and preset in PRESETS:
            brought = {name: value for name, value in load_preset(preset).as_dict().items()
                       if name not in given and name not in self._chosen}
            self._from_preset = set(brought)
            complete += [Parameter(name, value=value) for name, value in brought.items()]
        return complete

    def _check(self, parameters: list[Parameter]) -> SetParametersResult:
        try:
            self.current.updated({**self._chosen, **_ours(parameters)})
        except ValueError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply(self, parameters: list[Parameter]) -> None:
        changed = _ours(parameters)
        if not changed:
            return
        old, self.current = self.current, self.current.updated({**self._chosen, **changed})
        self._chosen.update({name: value for name, value in changed.items()
                             if name not in self._from_preset and name != 'preset'})
        if old.preset != self.current.preset:
            self._say_what_changed(old)
        self._on_change(old, self.current)

    def _say_what_changed(self, old: Params) -> None:
        before, after = old.as_dict(), self.current.as_dict()
        changed = [f'{name} {value}' for name, value in after.items() if value != before[name]]
        stays = ', '.join(sorted(self._chosen)) or 'nothing'
        self._node.get_logger().info(
            f'preset {self.current.preset}: now {", ".join(changed)}; as you set it stays '
            f'{stays}')


def _take_overrides(node: Node) -> dict[str, Any]:
    """Take what the command line and files set of ours; warn of what is nobody's."""
    given = {}
    for name, parameter in node.get_parameters_by_prefix('').items():
        if name in SPEC_BY_NAME:
            given[name] = parameter.value
            node.undeclare_parameter(name)
        elif is_foreign(name):
            node.get_logger().warning(explain(name))
            node.undeclare_parameter(name)
    return given


def _typed(parameter: Parameter) -> Parameter:
    spec = SPEC_BY_NAME.get(parameter.name)
    if spec is None:
        return parameter
    try:
        return Parameter(parameter.name, value=spec.check(parameter.value))
    except ValueError:
        return parameter  # `_check` refuses it with the reason


def _ours(parameters: list[Parameter]) -> dict[str, Any]:
    return {item.name: item.value for item in parameters if item.name in SPEC_BY_NAME}

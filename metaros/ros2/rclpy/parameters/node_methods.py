"""What a node can do with its parameters: `rclpy.node.Node` inherits it."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from metaros.limits import LIMITS
from metaros.node.parameters.store import groups_of, is_listed
from metaros.ros2.rclpy.core.publisher import Publisher
from metaros.ros2.rclpy.names.exceptions import (
    InvalidParameterTypeException,
    InvalidParameterValueException,
    ParameterAlreadyDeclaredException,
    ParameterImmutableException,
    ParameterNotDeclaredException,
    ParameterUninitializedException,
)
from metaros.ros2.rclpy.parameters.callbacks import ParameterCallbacks
from metaros.ros2.rclpy.parameters.conversion import parameters_of
from metaros.ros2.rclpy.parameters.declarations import read_declarations
from metaros.ros2.rclpy.parameters.events import ParameterEvents
from metaros.ros2.rclpy.parameters.rules import REL_TOL, WRONG_TYPE, refusal
from metaros.ros2.rclpy.parameters.value import PARAMETER_SEPARATOR_STRING, Parameter
from metaros.ros2.rosidl.catalogue import interface

__all__ = ["ParameterMethods"]

_EMPTIED: Final = "parameter list cannot be empty: a pre_set_parameters_callback may have emptied it"


class _Changes:
    """What a set did, in the terms of an event: a parameter without a value before is new."""

    def __init__(self) -> None:
        self.new: list[Parameter[Any]] = []
        self.changed: list[Parameter[Any]] = []
        self.deleted: list[Parameter[Any]] = []


def _result(reason: str = "") -> Any:
    return interface("rcl_interfaces/msg/SetParametersResult")(successful=not reason, reason=reason)


class ParameterMethods(ParameterCallbacks):
    """Parameters of one node, by name. The node calls `_init_parameters` before it declares any.

    Reading never waits. What is set at the same time from several threads is set one after the other, after the
    callbacks: they may themselves set parameters.
    """

    PARAM_REL_TOL: Final = REL_TOL
    _publishers: list[Publisher]

    def _init_parameters(
        self,
        *,
        given: Mapping[str, Any],
        overrides: Iterable[Parameter[Any]] | None,
        allow_undeclared: bool,
    ) -> None:
        """Begin without parameters. The node has its `handle` and its clock by now.

        `given` is what the command line says of the node, over which the program's `overrides` win.
        """
        self._init_callbacks()
        self._parameters: dict[str, Parameter[Any]] = {}
        self._descriptors: dict[str, Any] = {}
        self._allow_undeclared_parameters = allow_undeclared
        self._parameter_overrides = parameters_of(given) | {parameter.name: parameter for parameter in overrides or ()}
        self.__events = ParameterEvents(self)
        self._parameter_event_publisher = self.__events.publisher
        self._publishers.append(self._parameter_event_publisher)
        self.__applying = threading.Lock()

    def _declare_overrides(self) -> None:
        """Declare everything that overrides name: for `automatically_declare_parameters_from_overrides`."""
        descriptor = interface("rcl_interfaces/msg/ParameterDescriptor")
        given = [(name, parameter.value, descriptor()) for name, parameter in self._parameter_overrides.items()]
        self.declare_parameters("", given, ignore_override=True)

    # -- declaring -------------------------------------------------------------------------------------------------
    def declare_parameter(
        self, name: str, value: Any = None, descriptor: Any = None, ignore_override: bool = False
    ) -> Parameter[Any]:
        """Add a parameter; what it is now: an override, if the node was given one, else `value`.

        `value` may be a mere `Parameter.Type`. Name and type in the descriptor are ignored and filled in.

        Raises:
            ParameterAlreadyDeclaredException: there is one of that name.
            InvalidParameterException: the name is empty.
            InvalidParameterTypeException: an override is of another type.
            InvalidParameterValueException: a callback or the descriptor refuses the value.
        """
        if value is None and descriptor is None:
            return self.__declare("", [(name,)], ignore_override)[0]
        if descriptor is None:
            descriptor = interface("rcl_interfaces/msg/ParameterDescriptor")()
        return self.__declare("", [(name, value, descriptor)], ignore_override)[0]

    def declare_parameters(
        self, namespace: str, parameters: Sequence[Any], ignore_override: bool = False
    ) -> list[Parameter[Any]]:
        """Add several, each `(name,)`, `(name, value)`, `(name, type)` or one of these with a descriptor as its third.

        With a namespace they are `namespace.name`. They are set one by one: what was set before one that is refused
        stays. Errors as of `declare_parameter`; TypeError and ValueError where a tuple is none of these.
        """
        return self.__declare(namespace, parameters, ignore_override)

    def __declare(self, namespace: str, parameters: Sequence[Any], ignore_override: bool) -> list[Parameter[Any]]:
        declared = read_declarations(namespace, parameters, {} if ignore_override else self._parameter_overrides)
        known = [parameter.name for parameter, _ in declared if parameter.name in self._parameters]
        if known:
            raise ParameterAlreadyDeclaredException(known)
        for parameter, descriptor in declared:
            result = self.__set([parameter], {parameter.name: descriptor})
            if not result.successful and result.reason.startswith(WRONG_TYPE):
                raise InvalidParameterTypeException(parameter, Parameter.Type(descriptor.type).name)
            if not result.successful:
                raise InvalidParameterValueException(parameter.name, parameter.value, result.reason)
        return [self._parameters[parameter.name] for parameter, _ in declared]

    def undeclare_parameter(self, name: str) -> None:
        """Remove a parameter, without callbacks.

        Raises:
            ParameterNotDeclaredException: there is none of that name.
            ParameterImmutableException: it is read-only.
        """
        with self.__applying:
            if name not in self._parameters:
                raise ParameterNotDeclaredException(name)
            if self._descriptors[name].read_only:
                raise ParameterImmutableException(name)
            del self._parameters[name], self._descriptors[name]

    # -- reading ---------------------------------------------------------------------------------------------------

    def has_parameter(self, name: str) -> bool:
        """Whether it is declared."""
        return name in self._parameters

    def get_parameter(self, name: str) -> Parameter[Any]:
        """The parameter; one without a value where it is not declared and need not be.

        Raises:
            ParameterNotDeclaredException: it has to be declared.
            ParameterUninitializedException: it has a type and was not given a value yet.
        """
        parameter = self._parameters.get(name)
        if parameter is None:
            self.__need_not_be_declared(name)
            return Parameter(name, Parameter.Type.NOT_SET)
        if parameter.type_ is Parameter.Type.NOT_SET and not self.describe_parameter(name).dynamic_typing:
            raise ParameterUninitializedException(name)
        return parameter

    def get_parameters(self, names: Sequence[str]) -> list[Parameter[Any]]:
        """The parameters; errors as of `get_parameter`, TypeError where a name is no text."""
        return [self.get_parameter(name) for name in _texts(names)]

    def get_parameter_or(self, name: str, alternative_value: Parameter[Any] | None = None) -> Parameter[Any]:
        """The parameter, or the alternative (one without a value) where it is not declared or has no value."""
        parameter = self._parameters.get(name)
        if parameter is not None and parameter.type_ is not Parameter.Type.NOT_SET:
            return parameter
        return Parameter(name, Parameter.Type.NOT_SET) if alternative_value is None else alternative_value

    def get_parameters_by_prefix(self, prefix: str) -> dict[str, Parameter[Any]]:
        """The parameters below a prefix, by the rest of their names; without a prefix all."""
        start = f"{prefix}{PARAMETER_SEPARATOR_STRING}" if prefix else ""
        found = dict(self._parameters)
        return {name[len(start) :]: parameter for name, parameter in found.items() if name.startswith(start)}

    def get_parameter_type(self, name: str) -> Any:
        """The number of its type; `Parameter.Type.NOT_SET` itself, as in rclpy, where it need not be declared."""
        parameter = self._parameters.get(name)
        if parameter is not None:
            return parameter.type_.value
        self.__need_not_be_declared(name)
        return Parameter.Type.NOT_SET

    def get_parameter_types(self, names: Sequence[str]) -> list[Any]:
        """As `get_parameter_type`, of each; TypeError where a name is no text."""
        return [self.get_parameter_type(name) for name in _texts(names)]

    def list_parameters(self, prefixes: list[str], depth: int) -> Any:
        """Names below the prefixes (all without one) at most `depth` levels deep (0: any), and the groups they are in.

        A rcl_interfaces/msg/ListParametersResult. TypeError where these are no texts or no number, ValueError where
        the depth is negative.
        """
        if not isinstance(prefixes, list):
            raise TypeError(f"the prefixes must be a list, not {prefixes!r}")
        if not isinstance(depth, int):
            raise TypeError(f"the depth must be an int, not {depth!r}")
        if depth < 0:
            raise ValueError(f"the depth must not be negative: {depth}; 0 means all levels")
        _texts(prefixes)
        names = [name for name in list(self._parameters) if is_listed(name, prefixes, depth)]
        return interface("rcl_interfaces/msg/ListParametersResult")(names=names, prefixes=groups_of(names))

    # -- descriptors -----------------------------------------------------------------------------------------------

    def describe_parameter(self, name: str) -> Any:
        """Its descriptor, an empty one where it need not be declared; else ParameterNotDeclaredException."""
        descriptor = self._descriptors.get(name)
        if descriptor is not None:
            return descriptor
        self.__need_not_be_declared(name)
        return interface("rcl_interfaces/msg/ParameterDescriptor")()

    def describe_parameters(self, names: Sequence[str]) -> list[Any]:
        """As `describe_parameter`, of each."""
        return [self.describe_parameter(name) for name in names]

    def set_descriptor(self, name: str, descriptor: Any, alternative_value: Any = None) -> Any:
        """Replace its descriptor; its value after that, which is the alternative where the present one does not fit.

        Raises:
            ParameterNotDeclaredException: it has to be declared.
            ParameterImmutableException: it is read-only.
            InvalidParameterValueException: neither value fits the descriptor.
        """
        if not self.has_parameter(name):
            return self.get_parameter(name).get_parameter_value()
        if self.describe_parameter(name).read_only:
            raise ParameterImmutableException(name)
        present = self.get_parameter(name)
        values = [present]
        if alternative_value is not None:
            message = interface("rcl_interfaces/msg/Parameter")(name=name, value=alternative_value)
            values.append(Parameter.from_parameter_msg(message))
        reason = ""
        for parameter in values:
            reason = refusal(parameter, descriptor, declared=True, check_read_only=False)
            if not reason:
                with self.__applying:
                    self._parameters[name], self._descriptors[name] = parameter, descriptor
                return self.get_parameter(name).get_parameter_value()
        raise InvalidParameterValueException(name, values[-1].value, reason)

    # -- setting ---------------------------------------------------------------------------------------------------

    def set_parameters(self, parameter_list: Sequence[Parameter[Any]]) -> list[Any]:
        """Set each for itself, in order: a rcl_interfaces/msg/SetParametersResult of each. NOT_SET removes one.

        ParameterNotDeclaredException for one that has to be declared: those before it stay set.
        """
        return [self.set_parameters_atomically([parameter]) for parameter in parameter_list]

    def set_parameters_atomically(self, parameter_list: Sequence[Parameter[Any]]) -> Any:
        """Set all or none: one rcl_interfaces/msg/SetParametersResult. Errors as of `set_parameters`."""
        changed = self._call_pre_set_callbacks(parameter_list)
        if changed is not None:
            if not changed:
                return _result(_EMPTIED)
            parameter_list = changed
        for parameter in parameter_list:
            if not isinstance(parameter, Parameter):
                raise TypeError(f"{parameter!r} is no parameter: make it by rclpy.parameter.Parameter(name, value=…)")
        unknown = [parameter.name for parameter in parameter_list if parameter.name not in self._parameters]
        if unknown and not self._allow_undeclared_parameters:
            raise ParameterNotDeclaredException(unknown)
        return self.__set(parameter_list, None)

    def __set(self, parameters: Sequence[Parameter[Any]], descriptors: Mapping[str, Any] | None) -> Any:
        """Check, ask, set, tell. With `descriptors` they are declared, else those that there are apply."""
        rules = self._descriptors if descriptors is None else descriptors
        for parameter in parameters:
            if parameter.name in rules:
                declared = parameter.name in self._parameters
                rule = rules[parameter.name]
                reason = refusal(parameter, rule, declared=declared, check_read_only=descriptors is None)
                if reason:
                    return _result(reason)
        result = self._call_on_set_callbacks(parameters)
        if result is not None:
            return result
        if len(self._parameters.keys() | {parameter.name for parameter in parameters}) > LIMITS.parameters_per_node:
            return _result(f"a node takes {LIMITS.parameters_per_node} parameters")
        changes = _Changes()
        with self.__applying:
            for parameter in parameters:
                self.__apply(parameter, descriptors, changes)
        self.__events.publish(changes.new, changes.changed, changes.deleted)
        self._call_post_set_callbacks(parameters)
        return _result()

    def __apply(self, parameter: Parameter[Any], descriptors: Mapping[str, Any] | None, changes: _Changes) -> None:
        name = parameter.name
        if descriptors is None and parameter.type_ is Parameter.Type.NOT_SET:
            changes.deleted.append(parameter)
            self._parameters.pop(name, None)
            self._descriptors.pop(name, None)
            return
        if descriptors is not None:
            self._descriptors[name] = descriptors[name]
        elif name not in self._descriptors:
            descriptor = interface("rcl_interfaces/msg/ParameterDescriptor")
            self._descriptors[name] = descriptor(name=name, type=parameter.type_.value, dynamic_typing=True)
        is_new = self.get_parameter_or(name).type_ is Parameter.Type.NOT_SET
        (changes.new if is_new else changes.changed).append(parameter)
        self._parameters[name] = parameter

    def __need_not_be_declared(self, name: str) -> None:
        if not self._allow_undeclared_parameters:
            raise ParameterNotDeclaredException(name)


def _texts(names: Sequence[str]) -> Sequence[str]:
    for name in names:
        if not isinstance(name, str):
            raise TypeError(f"{name!r} is no name: all must be str")
    return names

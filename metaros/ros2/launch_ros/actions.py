"""Actions that start nodes, and those that say how the nodes after them are called and set."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from metaros.ros2.launch.actions.flow import TimerAction
from metaros.ros2.launch.actions.process import ExecuteProcess
from metaros.ros2.launch.entities import Action, LaunchDescriptionEntity
from metaros.ros2.launch.substitution import SomeSubstitutionsType, perform_substitutions
from metaros.ros2.launch_ros.parameter_descriptions import Parameter, ParameterFile, flattened
from metaros.ros2.programs import find_program

__all__ = [
    "ComposableNodeContainer",
    "LifecycleNode",
    "LoadComposableNodes",
    "Node",
    "PushROSNamespace",
    "PushRosNamespace",
    "ROSTimer",
    "RosTimer",
    "SetParameter",
    "SetParametersFromFile",
    "SetROSLogDir",
    "SetRemap",
    "SetUseSimTime",
]

_NAMESPACE, _PARAMETERS, _REMAPS = "ros_namespace", "global_params", "ros_remaps"  # configurations, as in launch_ros


class Node(ExecuteProcess):
    """A node: `executable` of `package`, or without a package a program; with ROS arguments of what is given here."""

    def __init__(
        self,
        *,
        executable: SomeSubstitutionsType,
        package: SomeSubstitutionsType | None = None,
        name: SomeSubstitutionsType | None = None,
        namespace: SomeSubstitutionsType | None = None,
        exec_name: SomeSubstitutionsType | None = None,
        parameters: Iterable[Any] | None = None,
        remappings: Iterable[tuple[SomeSubstitutionsType, SomeSubstitutionsType]] | None = None,
        ros_arguments: Iterable[SomeSubstitutionsType] | None = None,
        arguments: Iterable[SomeSubstitutionsType] | None = None,
        **options: Any,
    ) -> None:
        super().__init__(cmd=[executable], name=exec_name, **options)
        self.node_package, self.node_executable = package, executable
        self._node_name, self._namespace = name, namespace
        self._parameters = list(parameters or ())
        self._remappings = list(remappings or ())
        self._ros_arguments, self._arguments = list(ros_arguments or ()), list(arguments or ())

    def words(self, context: Any) -> list[str]:
        """The command with `--ros-args`."""
        program = self._program(context)
        own = [perform_substitutions(context, word) for word in self._arguments]
        told = [perform_substitutions(context, word) for word in self._ros_arguments]
        if self._node_name is not None:
            told += ["-r", f"__node:={perform_substitutions(context, self._node_name)}"]
        namespace = self.namespace(context)
        if namespace:
            told += ["-r", f"__ns:={namespace}"]
        remaps = [*context.launch_configurations.get(_REMAPS, ()), *self._remappings]
        for one, other in remaps:
            told += ["-r", f"{perform_substitutions(context, one)}:={perform_substitutions(context, other)}"]
        for path in self._parameter_files(context):
            told += ["--params-file", str(path)]
        prefix = super().words(context)[: -len(self.cmd)]
        return [*prefix, *program, *own, "--ros-args", *told]

    def namespace(self, context: Any) -> str:
        """With those of the groups that it is in; "" where nothing is said of it."""
        outer = str(context.launch_configurations.get(_NAMESPACE, ""))
        inner = "" if self._namespace is None else perform_substitutions(context, self._namespace)
        return _joined(outer, inner)

    def _program(self, context: Any) -> list[str]:
        name = perform_substitutions(context, self.node_executable)
        if self.node_package is None:
            return [sys.executable, "-m", "metaros.ros2", name] if name.endswith(".py") else [name]
        package = perform_substitutions(context, self.node_package)
        program, _ = find_program([package, name], environ=context.environment)
        if program.binary is not None:
            return [str(program.binary)]
        return [sys.executable, "-m", "metaros", "ros2", "run", package, name]

    def _parameter_files(self, context: Any) -> list[Path]:
        """Values given here are written to files, which have types, as command lines have not."""
        given = [*context.launch_configurations.get(_PARAMETERS, ()), *self._parameters]
        files: list[Path] = []
        values: dict[str, Any] = {}
        for item in given:
            if isinstance(item, Mapping):
                values |= flattened(context, item)
            elif isinstance(item, Parameter):
                values[perform_substitutions(context, item.name)] = item.evaluate(context)
            else:
                files += _written(context, values)
                values = {}
                file = item if isinstance(item, ParameterFile) else ParameterFile(item)
                files.append(file.evaluate(context, context.runner.log_dir))
        return [*files, *_written(context, values)]


def _written(context: Any, values: Mapping[str, Any]) -> list[Path]:
    if not values:
        return []
    import yaml

    folder: Path = context.runner.log_dir
    path = folder / f"parameters_{len(list(folder.iterdir()))}.yaml"
    path.write_text(yaml.safe_dump({"/**": {"ros__parameters": dict(values)}}), encoding="utf-8")
    return [path]


def _joined(outer: str, inner: str) -> str:
    found = f"{outer.rstrip('/')}/{inner}" if outer and inner and not inner.startswith("/") else inner or outer
    return f"/{found.strip('/')}" if found.strip("/") else ("/" if found else "")


class PushRosNamespace(Action):
    """A namespace for the nodes after it, in its group."""

    def __init__(self, namespace: SomeSubstitutionsType, **options: Any) -> None:
        super().__init__(**options)
        self._namespace = namespace

    def execute(self, context: Any) -> None:
        """Add it."""
        outer = str(context.launch_configurations.get(_NAMESPACE, ""))
        inner = perform_substitutions(context, self._namespace)
        context.launch_configurations[_NAMESPACE] = _joined(outer, inner)


PushROSNamespace = PushRosNamespace


class _Add(Action):
    """Something for the nodes after it, in its group."""

    def __init__(self, configuration: str, value: Any, **options: Any) -> None:
        super().__init__(**options)
        self._configuration, self._value = configuration, value

    def execute(self, context: Any) -> None:
        """Add it: to a list of its own, since groups keep what was before."""
        found = context.launch_configurations.get(self._configuration, ())
        context.launch_configurations[self._configuration] = [*found, self._value]


class SetParameter(_Add):
    """A parameter of the nodes after it."""

    def __init__(self, name: SomeSubstitutionsType, value: Any, **options: Any) -> None:
        super().__init__(_PARAMETERS, Parameter(name, value), **options)


class SetUseSimTime(SetParameter):
    """Whether the nodes after it follow /clock."""

    def __init__(self, value: bool | SomeSubstitutionsType, **options: Any) -> None:
        super().__init__("use_sim_time", value, **options)


class SetParametersFromFile(_Add):
    """A parameter file of the nodes after it."""

    def __init__(self, filename: SomeSubstitutionsType, **options: Any) -> None:
        options.pop("node_name", None)
        super().__init__(_PARAMETERS, ParameterFile(filename), **options)


class SetRemap(_Add):
    """A remapping of the nodes after it."""

    def __init__(self, src: SomeSubstitutionsType, dst: SomeSubstitutionsType, **options: Any) -> None:
        super().__init__(_REMAPS, (src, dst), **options)


class SetROSLogDir(Action):
    """Where the nodes after it log."""

    def __init__(self, new_log_dir: SomeSubstitutionsType, **options: Any) -> None:
        super().__init__(**options)
        self._log_dir = new_log_dir

    def execute(self, context: Any) -> None:
        """Set it in their environment."""
        context.environment["ROS_LOG_DIR"] = perform_substitutions(context, self._log_dir)


class RosTimer(TimerAction):
    """Actions after a time. It counts the computer's time also where nodes follow /clock."""


ROSTimer = RosTimer


class LifecycleNode(Node):
    """A node with a lifecycle; `name` and `namespace` must be given. With `autostart` it is configured and activated.

    Events that change its state: `launch_ros.events.lifecycle.ChangeState`.
    """

    def __init__(
        self, *, name: SomeSubstitutionsType, namespace: SomeSubstitutionsType, autostart: bool = False, **options: Any
    ) -> None:
        super().__init__(name=name, namespace=namespace, **options)
        self._autostart = autostart

    def full_name(self, context: Any) -> str:
        """Its name in the graph."""
        assert self._node_name is not None
        return f"{self.namespace(context).rstrip('/')}/{perform_substitutions(context, self._node_name)}"

    def execute(self, context: Any) -> list[LaunchDescriptionEntity] | None:
        """Start it, and follow its state."""
        from metaros.ros2.launch_ros.lifecycle import follow

        follow(self, context, autostart=self._autostart)
        return super().execute(context)


class _NotUnderstood(Action):
    """Said when met, and left out."""

    def __init__(self, *_: Any, condition: Any = None, **__: Any) -> None:
        super().__init__(condition=condition)

    def execute(self, context: Any) -> None:
        """Say so."""
        context.runner.not_understood(f"{type(self).__name__}: composable nodes are C++ libraries")


class ComposableNodeContainer(_NotUnderstood):
    """A process that loads composable nodes: C++ libraries, which are not run here."""


class LoadComposableNodes(_NotUnderstood):
    """Composable nodes for a container."""

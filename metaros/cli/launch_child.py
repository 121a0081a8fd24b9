"""Run as `python -m metaros.cli.launch_child module|class|driver|ros2 WHAT ARGUMENT...`: a node of a launch table.

With `spare` alone it stands by until a line on its input tells which node to be. It asks by itself to die with the
launcher, which saves the interpreter that the guard would cost, takes the `--ros-args` out of the command line for the
nodes, and becomes the module, runs the driver, or makes the class's node and spins it. A program written for ROS 2
keeps its command line: it reads it by itself. Only what it needs is imported: this is the start of every supervised
node.
"""

from __future__ import annotations

import os
import sys

from metaros.supervise import parent_death

__all__ = ["main"]

CONFIG_EXIT_CODE = 78


def main() -> None:
    """Be the node; exit code 78 where its configuration is wrong, so that nobody starts it again in vain."""
    parent = os.environ.get(parent_death.PARENT, "")
    if parent.isdigit():
        parent_death.die_with_parent(int(parent))
    from metaros.errors import ConfigError, NameError_, ParameterError

    arguments = sys.argv[1:]
    if arguments == ["spare"]:
        arguments = _stand_by()
    try:
        _run(*arguments)
    except KeyboardInterrupt:
        sys.exit(130)
    except (ConfigError, NameError_, ParameterError) as error:
        sys.stderr.write(f"{error}\n")
        sys.exit(CONFIG_EXIT_CODE)


def _stand_by() -> list[str]:
    """Import what every node needs, and wait for the line that names the node; at the end of the input exit."""
    import json
    from importlib import import_module

    from metaros.cdr import codec

    import_module("metaros.node")
    codec("rcl_interfaces/msg/Log")
    try:
        order = sys.stdin.buffer.readline()
    except KeyboardInterrupt:
        order = b""
    if not order:
        sys.exit(0)
    wanted = json.loads(order)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    os.environ.clear()
    os.environ.update(wanted["env"])
    return list(wanted["arguments"])


def _run(kind: str, what: str, *arguments: str) -> None:
    if kind == "ros2":
        import shlex

        from metaros.ros2.programs import find_program, run_program

        run_program(find_program(shlex.split(what))[0], arguments, say=lambda note: sys.stderr.write(f"{note}\n"))
    from metaros.node.arguments import take_ros_args

    sys.argv = [what, *take_ros_args(arguments)]
    if kind == "class":
        _spin_class(what)
    elif kind == "driver":
        from metaros.drivers.run import main as run_driver

        sys.argv = ["metaros.drivers.run", what, *sys.argv[1:]]
        run_driver()
    else:
        import runpy

        runpy.run_module(what, run_name="__main__", alter_sys=True)


def _spin_class(what: str) -> None:
    """Make the node and spin it until it is asked to end."""
    import signal

    signal.signal(signal.SIGTERM, signal.default_int_handler)  # so that it is closed at either request
    node = load_class(what)()
    from metaros.node import spin

    try:
        spin(node)
    finally:
        node.context.close()


def load_class(what: str) -> type:
    """The class `package.module:Class`; ConfigError where there is none."""
    import importlib

    from metaros.errors import ConfigError

    module_name, _, path = what.partition(":")
    found: object = importlib.import_module(module_name)
    for part in path.split("."):
        if not hasattr(found, part):
            raise ConfigError(f"module {module_name} has no class {path}")
        found = getattr(found, part)
    if not isinstance(found, type):
        raise ConfigError(f"{what} is no class")
    return found


if __name__ == "__main__":
    main()

"""`rclpy`, in the shape that programs for ROS 2 Jazzy know, on this library's nodes.

A program says `init`, makes a node, spins it, and says `shutdown`. `import rclpy` alone loads little: the rest comes
when it is used, so that a node starts quickly.
"""

from __future__ import annotations

import importlib
import threading
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Final

from metaros.ros2.borrowed_names import lend
from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.signals import SignalHandlerOptions, install_signal_handlers, uninstall_signal_handlers
from metaros.ros2.rclpy.core.utilities import (
    get_default_context,
    get_rmw_implementation_identifier,
    ok,
    try_shutdown,
)
from metaros.ros2.rclpy.core.utilities import shutdown as _shutdown
from metaros.ros2.rclpy.module_names import HOMES

if TYPE_CHECKING:
    from metaros.ros2.rclpy.core.node import Node
    from metaros.ros2.rclpy.execution.executors import Executor
    from metaros.ros2.rclpy.execution.task import Future
    from metaros.ros2.rclpy.parameters.parameter import Parameter

__all__ = [
    "Context",
    "Future",
    "InitContextManager",
    "Node",
    "Parameter",
    "SignalHandlerOptions",
    "create_node",
    "get_default_context",
    "get_global_executor",
    "get_rmw_implementation_identifier",
    "init",
    "install_signal_handlers",
    "ok",
    "shutdown",
    "spin",
    "spin_once",
    "spin_until_future_complete",
    "try_shutdown",
    "uninstall_signal_handlers",
]

_LATER: Final = {
    "Future": "execution.task",
    "Node": "core.node",
    "Parameter": "parameters.parameter",
}


def __getattr__(name: str) -> Any:
    """Classes that not every program needs, and the modules of rclpy, as after `import rclpy.executors`."""
    if name in _LATER:
        return getattr(importlib.import_module(f"{__name__}.{_LATER[name]}"), name)
    if name in HOMES:
        module = importlib.import_module(f"{__name__}.{HOMES[name]}")
        lend(f"rclpy.{name}", module)
        return module
    raise AttributeError(f"module 'rclpy' has no attribute {name!r}")


class InitContextManager:
    """What `init` returns: `with rclpy.init(): …` shuts down at the end of the block, as `try_shutdown` does."""

    def __init__(self, context: Context, installed: SignalHandlerOptions) -> None:
        self.context = context
        self.installed_signal_handler_options = installed

    def __enter__(self) -> InitContextManager:
        return self

    def __exit__(self, *_: object) -> None:
        if self.context is get_default_context():
            try_shutdown()
        else:
            self.context.try_shutdown()
        if self.installed_signal_handler_options is not SignalHandlerOptions.NO:
            uninstall_signal_handlers()


def init(
    *,
    args: Sequence[str] | None = None,
    context: Context | None = None,
    domain_id: int | None = None,
    signal_handler_options: SignalHandlerOptions | None = None,
) -> InitContextManager:
    """Begin: initialise a context, or the default one; for that one SIGINT and SIGTERM shut contexts down.

    `args` stand in for the process's command line, `domain_id` for ROS_DOMAIN_ID. Errors as of `Context.init`.
    """
    chosen = get_default_context() if context is None else context
    if context is None and chosen.was_initialized and not chosen.ok():  # by a signal, or by its own shutdown()
        try_shutdown()
        chosen = get_default_context()
    if signal_handler_options is None:
        default = chosen is get_default_context()
        signal_handler_options = SignalHandlerOptions.ALL if default else SignalHandlerOptions.NO
    chosen.init(args, domain_id=domain_id)
    install_signal_handlers(signal_handler_options)
    return InitContextManager(chosen, signal_handler_options)


def shutdown(*, context: Context | None = None, uninstall_handlers: bool | None = None) -> None:
    """End a context, or the default one, with its nodes; its handlers of signals go with the default one.

    RuntimeError where it was not initialised, or is shut down already: `try_shutdown` does not mind.
    """
    is_default = context is None or context is get_default_context()
    _shutdown(context=context)
    if uninstall_handlers or (uninstall_handlers is None and is_default):
        uninstall_signal_handlers()


def create_node(
    node_name: str,
    *,
    context: Context | None = None,
    cli_args: Sequence[str] | None = None,
    namespace: str | None = None,
    use_global_arguments: bool = True,
    enable_rosout: bool = True,
    rosout_qos_profile: Any = None,
    start_parameter_services: bool = True,
    parameter_overrides: Iterable[Parameter[Any]] | None = None,
    allow_undeclared_parameters: bool = False,
    automatically_declare_parameters_from_overrides: bool = False,
    enable_logger_service: bool = False,
) -> Node:
    """Make a node; the options and errors are those of `Node`."""
    from metaros.ros2.rclpy.core.node import Node as NodeClass

    options: dict[str, Any] = {} if rosout_qos_profile is None else {"rosout_qos_profile": rosout_qos_profile}
    return NodeClass(
        node_name,
        context=context,
        cli_args=cli_args,
        namespace=namespace,
        use_global_arguments=use_global_arguments,
        enable_rosout=enable_rosout,
        start_parameter_services=start_parameter_services,
        parameter_overrides=parameter_overrides,
        allow_undeclared_parameters=allow_undeclared_parameters,
        automatically_declare_parameters_from_overrides=automatically_declare_parameters_from_overrides,
        enable_logger_service=enable_logger_service,
        **options,
    )


class _Global:
    """The executor of `spin`, kept from call to call: tasks that wait go on where the next call spins."""

    def __init__(self) -> None:
        self.lock = threading.RLock()  # a program's handler of signals may shut down in the middle of anything
        self.executor: Executor | None = None


_global = _Global()


def get_global_executor() -> Executor:
    """The executor that `spin`, `spin_once` and `spin_until_future_complete` use where they are given none."""
    from metaros.ros2.rclpy.execution.executors import SingleThreadedExecutor

    with _global.lock:
        if _global.executor is not None:
            return _global.executor
        executor = _global.executor = SingleThreadedExecutor()
    get_default_context().on_shutdown(_forget_executor)  # at once, where the default context is shut down already
    return executor


def _forget_executor() -> None:
    with _global.lock:
        executor, _global.executor = _global.executor, None
    if executor is not None:
        executor.shutdown()


def spin_once(node: Node, *, executor: Executor | None = None, timeout_sec: float | None = None) -> None:
    """Run one callback of the node, waiting up to `timeout_sec` for it; without one, or with less than 0, for ever."""
    executor = get_global_executor() if executor is None else executor
    try:
        executor.add_node(node)
        executor.spin_once(timeout_sec=timeout_sec)
    finally:
        executor.remove_node(node)


def spin(node: Node, executor: Executor | None = None) -> None:
    """Run the callbacks of the node until the context is shut down.

    Raises:
        KeyboardInterrupt: Ctrl-C.
        ExternalShutdownException: the context was shut down from elsewhere while nothing was to do.
    """
    executor = get_global_executor() if executor is None else executor
    try:
        executor.add_node(node)
        executor.spin()
    finally:
        executor.remove_node(node)


def spin_until_future_complete(
    node: Node, future: Future[Any], executor: Executor | None = None, timeout_sec: float | None = None
) -> None:
    """Run the callbacks of the node until the future is done, the context shut down, or the time over."""
    executor = get_global_executor() if executor is None else executor
    added = False
    try:
        added = executor.add_node(node)
        executor.spin_until_future_complete(future, timeout_sec)
    finally:
        if added:
            executor.remove_node(node)

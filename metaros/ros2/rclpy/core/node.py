"""`rclpy.node`: the node of ROS 2 programs."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, Final

from metaros.executor import CallbackGroup
from metaros.ros2.rclpy.core.client import Client
from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.endpoint_methods import EndpointMethods, qos_or_depth
from metaros.ros2.rclpy.core.graph_methods import GraphMethods
from metaros.ros2.rclpy.core.graph_wait import wait_in_graph
from metaros.ros2.rclpy.core.handles import NodeHandle
from metaros.ros2.rclpy.core.publisher import Publisher
from metaros.ros2.rclpy.core.rcl_errors import InvalidHandle, NodeNameNonExistentError
from metaros.ros2.rclpy.core.ros_arguments import node_arguments, parse_arguments
from metaros.ros2.rclpy.core.service import Service
from metaros.ros2.rclpy.core.subscription import Subscription
from metaros.ros2.rclpy.core.type_description_service import TypeDescriptionService
from metaros.ros2.rclpy.core.utilities import get_default_context
from metaros.ros2.rclpy.execution.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from metaros.ros2.rclpy.execution.guard_condition import GuardCondition
from metaros.ros2.rclpy.execution.waitable import Waitable
from metaros.ros2.rclpy.logging.loggers import node_logger
from metaros.ros2.rclpy.names.exceptions import NotInitializedException
from metaros.ros2.rclpy.names.validate_namespace import validate_namespace
from metaros.ros2.rclpy.names.validate_node_name import validate_node_name
from metaros.ros2.rclpy.parameters.node_methods import ParameterMethods
from metaros.ros2.rclpy.parameters.parameter_service import ParameterService
from metaros.ros2.rclpy.parameters.value import Parameter
from metaros.ros2.rclpy.qos.conversion import to_native
from metaros.ros2.rclpy.qos.profile import QoSProfile, qos_profile_rosout_default
from metaros.ros2.rclpy.time.clock import Clock, ROSClock
from metaros.ros2.rclpy.time.rate import Rate
from metaros.ros2.rclpy.time.time_source import TimeSource
from metaros.ros2.rclpy.time.timer import Timer

__all__ = ["HIDDEN_NODE_PREFIX", "Node", "NodeNameNonExistentError"]

HIDDEN_NODE_PREFIX: Final = "_"
_S_TO_NS: Final = 1_000_000_000


class Node(EndpointMethods, ParameterMethods, GraphMethods):
    """A node: a name in the graph with publishers, subscriptions, services, clients, timers and parameters.

    An executor runs its callbacks: `rclpy.spin(node)`. `destroy_node()` or its context's shutdown ends it, or the end
    of a `with` block.

    `cli_args` are ROS arguments for this node alone; with `use_global_arguments` those of the context count as well.
    `parameter_overrides` win over both. `handle` is the library's own node, of which everything else may be used.

    Raises:
        NotInitializedException: the context is not initialised.
        InvalidNodeNameException, InvalidNamespaceException: the names are none.
        UnknownROSArgsError, RCLInvalidROSArgsError: `cli_args` cannot be read.
    """

    def __init__(
        self,
        node_name: str,
        *,
        context: Context | None = None,
        cli_args: Sequence[str] | None = None,
        namespace: str | None = None,
        use_global_arguments: bool = True,
        enable_rosout: bool = True,
        rosout_qos_profile: QoSProfile | int = qos_profile_rosout_default,
        start_parameter_services: bool = True,
        parameter_overrides: Iterable[Parameter[Any]] | None = None,
        allow_undeclared_parameters: bool = False,
        automatically_declare_parameters_from_overrides: bool = False,
        enable_logger_service: bool = False,
    ) -> None:
        self._context = get_default_context() if context is None else context
        self._timers: list[Timer] = []
        self._guards: list[GuardCondition] = []
        self.__waitables: list[Waitable[Any]] = []
        self.__executor: weakref.ref[Any] | None = None
        self.__gone_with_context = False
        self._default_callback_group = MutuallyExclusiveCallbackGroup()
        self._rate_group = ReentrantCallbackGroup()
        self._init_endpoints()
        native_context = self._context.handle
        if native_context is None or not self._context.ok():
            raise NotInitializedException("cannot create node")
        namespace = "/" + (namespace or "").removeprefix("/")
        arguments = node_arguments(
            validate_and_return(node_name, namespace),
            namespace,
            of_context=self._context.arguments if use_global_arguments else None,
            of_node=None if cli_args is None else parse_arguments(cli_args, implied=True),
        )
        self.__node = NodeHandle(arguments, context=native_context, rclpy_context=self._context)
        try:
            if enable_rosout and arguments.rosout_logs:
                self.__node.start_rosout(to_native(qos_or_depth(rosout_qos_profile), publishes=True))
            self._logger = node_logger(self.__node)
            self._clock = ROSClock()
            self._init_parameters(
                given=arguments.parameters, overrides=parameter_overrides, allow_undeclared=allow_undeclared_parameters
            )
            if automatically_declare_parameters_from_overrides:
                self._declare_overrides()
            self._time_source = TimeSource(node=self)
            self._time_source.attach_clock(self._clock)
            if start_parameter_services:
                self._parameter_service = ParameterService(self)
            if enable_logger_service:
                self.__offer_logger_levels()
            self._type_description_service = TypeDescriptionService(self)
        except BaseException:
            self.__node.close()
            raise
        self.__node.made()
        weakref.finalize(self, self.__node.abandon).atexit = False
        self._context.track_node(self)

    def __offer_logger_levels(self) -> None:
        from metaros.ros2.rclpy.logging.logging_service import LoggingService

        self._logger_service = LoggingService(self)

    # -- what it is ------------------------------------------------------------------------------------------------

    @property
    def handle(self) -> NodeHandle:  # type: ignore[override]  # it cannot be set
        """The library's node."""
        return self.__node

    @property
    def context(self) -> Context:
        """Its context."""
        return self._context

    @property
    def default_callback_group(self) -> CallbackGroup:  # type: ignore[override]  # it cannot be set
        """The group of what is created without one: its callbacks run one at a time."""
        return self._default_callback_group

    @property
    def publishers(self) -> Iterator[Publisher]:
        """Its publishers."""
        return iter(self._publishers)

    @property
    def subscriptions(self) -> Iterator[Subscription]:
        """Its subscriptions."""
        return iter(self._subscriptions)

    @property
    def clients(self) -> Iterator[Client]:
        """Its clients."""
        return iter(self._clients)

    @property
    def services(self) -> Iterator[Service]:
        """Its service servers."""
        return iter(self._services)

    @property
    def timers(self) -> Iterator[Timer]:
        """Its timers."""
        return iter(self._timers)

    @property
    def guards(self) -> Iterator[GuardCondition]:
        """Its guard conditions."""
        return iter(self._guards)

    @property
    def waitables(self) -> Iterator[Waitable[Any]]:
        """Its waitables."""
        return iter(self.__waitables)

    @property
    def executor(self) -> Any:
        """The executor that it was added to, or None; setting it takes it from the one before."""
        return None if self.__executor is None else self.__executor()

    @executor.setter
    def executor(self, new_executor: Any) -> None:
        present = self.executor
        if present == new_executor:
            return
        if present is not None:
            present.remove_node(self)
        if new_executor is None:
            self.__executor = None
        else:
            new_executor.add_node(self)
            self.__executor = weakref.ref(new_executor)

    def _wake_executor(self) -> None:
        executor = self.executor
        if executor is not None:
            executor.wake()

    def get_name(self) -> str:
        """Its name, remapped."""
        with self.__node:
            return self.__node.name

    def get_namespace(self) -> str:
        """Its namespace, remapped."""
        with self.__node:
            return self.__node.namespace

    def get_fully_qualified_name(self) -> str:
        """Both."""
        with self.__node:
            return self.__node.full_name

    def get_clock(self) -> Clock:
        """Its clock: simulated time where the parameter use_sim_time says so, else the system's."""
        return self._clock

    def get_logger(self) -> Any:
        """Its logger."""
        return self._logger

    def wait_for_node(self, fully_qualified_node_name: str, timeout: float) -> bool:
        """Wait up to `timeout` seconds for another node to be in the graph, or to the shutdown; whether it is."""
        wanted, graph = f"/{fully_qualified_node_name.lstrip('/')}", self.__node.graph

        def is_there() -> bool:
            return any(node.full_name == wanted for node in graph.nodes())

        return wait_in_graph(graph, is_there, timeout, self.context.ok)

    # -- what it creates besides endpoints -------------------------------------------------------------------------

    def create_timer(
        self,
        timer_period_sec: float,
        callback: Callable[..., Any] | None,
        callback_group: CallbackGroup | None = None,
        clock: Clock | None = None,
        autostart: bool = True,
    ) -> Timer:
        """Call `callback()` every so many seconds of `clock`, or of the node's; without `autostart` from `reset` on."""
        group = callback_group or self.default_callback_group
        period_ns = int(float(timer_period_sec) * _S_TO_NS)
        timer = Timer(callback, group, period_ns, clock or self._clock, context=self._context, autostart=autostart)
        self.__join(group, timer)
        self._timers.append(timer)
        self._wake_executor()
        return timer

    def create_guard_condition(
        self, callback: Callable[[], Any] | None, callback_group: CallbackGroup | None = None
    ) -> GuardCondition:
        """Call `callback()` on the executor after `trigger()`."""
        group = callback_group or self.default_callback_group
        guard = GuardCondition(callback, group, context=self._context)
        self.__join(group, guard)
        self._guards.append(guard)
        self._wake_executor()
        return guard

    def create_rate(self, frequency: float, clock: Clock | None = None) -> Rate:
        """For loops that run `frequency` times a second on a thread of their own; ValueError unless it is positive."""
        if frequency <= 0:
            raise ValueError(f"frequency must be > 0, not {frequency}")
        return Rate(self.create_timer(1.0 / frequency, None, self._rate_group, clock), context=self._context)

    def add_waitable(self, waitable: Waitable[Any]) -> None:
        """Have the executor wait for it."""
        self.__waitables.append(waitable)
        self._wake_executor()

    def remove_waitable(self, waitable: Waitable[Any]) -> None:
        """The reverse of `add_waitable`; ValueError where it was not added."""
        self.__waitables.remove(waitable)
        self._wake_executor()

    @staticmethod
    def __join(group: CallbackGroup, entity: Any) -> None:
        add = getattr(group, "add_entity", None)  # a group of the library itself keeps no list
        if add is not None:
            add(entity)

    # -- the end ---------------------------------------------------------------------------------------------------

    def destroy_timer(self, timer: Timer) -> bool:
        """End a timer of this node; whether there was something to end."""
        return self.__destroy(timer, self._timers)

    def destroy_guard_condition(self, guard: GuardCondition) -> bool:
        """End a guard condition of this node; whether there was something to end."""
        return self.__destroy(guard, self._guards)

    def destroy_rate(self, rate: Rate) -> bool:
        """End a rate of this node; whether there was something to end."""
        success = self.destroy_timer(rate._timer)
        rate.destroy()
        return success

    def __destroy(self, entity: Any, among: list[Any]) -> bool:
        if entity not in among:
            return False
        among.remove(entity)
        try:
            entity.destroy()
        except InvalidHandle:
            return False
        self._wake_executor()
        return True

    def destroy_node(self) -> None:
        """End it with all that it created. InvalidHandle the second time; after its context's shutdown nothing."""
        if self.__gone_with_context:
            self.__gone_with_context = False
            return
        while self._publishers:
            self.destroy_publisher(self._publishers[0])
        while self._subscriptions:
            self.destroy_subscription(self._subscriptions[0])
        while self._clients:
            self.destroy_client(self._clients[0])
        while self._services:
            self.destroy_service(self._services[0])
        while self._timers:
            self.destroy_timer(self._timers[0])
        while self._guards:
            self.destroy_guard_condition(self._guards[0])
        self._context.untrack_node(self)
        with self.__node:  # which says so where it was destroyed already
            self.__node.destroy_when_not_in_use()
        self._wake_executor()

    def _destroy_with_context(self) -> None:
        """The context is shut down: that a program destroys the node as well, afterwards, is no error."""
        self.destroy_node()
        self.__gone_with_context = True

    def __enter__(self) -> Node:
        return self

    def __exit__(self, *_: object) -> None:
        self.destroy_node()


def validate_and_return(node_name: str, namespace: str) -> str:
    """The name, if both are in order; rclpy's errors otherwise."""
    validate_node_name(node_name)
    validate_namespace(namespace)
    return node_name

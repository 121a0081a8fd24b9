"""A node: a name in the graph, and the factory of its publishers, subscriptions, services, clients and actions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Any, TypeVar

import zenoh

from metaros.cdr import codec
from metaros.errors import UsageError
from metaros.executor import CallbackGroup
from metaros.idl import message_class, names
from metaros.limits import LIMITS
from metaros.node import heartbeat
from metaros.node.arguments import process_arguments
from metaros.node.client import Client, RawClient, make_client
from metaros.node.clock_topic import follow_clock
from metaros.node.context import Context
from metaros.node.core import NodeCore
from metaros.node.endpoint import as_qos
from metaros.node.events import PublisherEvents, SubscriptionEvents
from metaros.node.introspection import offer_logger_levels, offer_type_description
from metaros.node.parameters import NodeParameters, declare_sim_time, make_parameters, offer_parameters
from metaros.node.plain_values import make_publisher, make_subscription
from metaros.node.publisher import Publisher, RawPublisher
from metaros.node.service import Service
from metaros.node.subscription import RawSubscription, Subscription
from metaros.node.time.sim_time import SimClock
from metaros.wire import QoSProfile, qos_default, qos_rosout, qos_services

if TYPE_CHECKING:
    from pathlib import Path

    from metaros.node.action import ActionClient, ActionServer, ServerGoal
    from metaros.node.parameters import ParameterClient

__all__ = ["Node"]

F = TypeVar("F", bound=Callable[..., Any])


class Node(NodeCore):
    """A node of the ROS graph. Use it as a context manager, or `close` it; its context closes it too.

    `context` defaults to one that all such nodes of the process share. `enable_rosout` publishes what the node logs
    on /rosout. `enable_parameters` offers the services of every ROS 2 node: parameters, events of them and type
    descriptions. `parameter_overrides`, and those that a ROS 2 `parameter_file` has for this node, replace defaults.
    `nice`, -20 to 19, and `critical` say what a `FairExecutor` gives the node; other executors do not ask.
    With `use_sim_time`, which is a parameter too, the node's clock, timers and rates follow /clock.
    """

    def __init__(
        self,
        name: str,
        *,
        namespace: str = "/",
        context: Context | None = None,
        enable_rosout: bool = True,
        enable_parameters: bool = True,
        enable_logger_service: bool = False,
        parameter_overrides: Mapping[str, Any] | None = None,
        parameter_file: str | Path | None = None,
        allow_undeclared_parameters: bool = False,
        nice: int = 0,
        critical: bool = False,
        use_sim_time: bool = False,
    ) -> None:
        namespace = "/" + namespace.strip("/") if namespace else "/"
        arguments = process_arguments().for_node(names.validate_node(name), names.validate_namespace(namespace))
        self.parameters: NodeParameters = make_parameters(
            arguments.full_name,
            given=arguments.parameters,
            overrides=parameter_overrides,
            file=parameter_file,
            allow_undeclared=allow_undeclared_parameters,
        )
        use_sim_time = declare_sim_time(self.parameters, use_sim_time)
        super().__init__(arguments, context=context, use_sim_time=use_sim_time, nice=nice, critical=critical)
        if enable_rosout and arguments.rosout_logs:
            self._logger.publish_with(self._rosout())
        if enable_parameters:
            offer_parameters(self, self.parameters)
            offer_type_description(self)
        if enable_logger_service:
            offer_logger_levels(self)
        if isinstance(self.clock, SimClock):
            follow_clock(self, self.clock)
        heartbeat.follow(self)

    # -- topics ----------------------------------------------------------------------------------------------------

    def create_publisher(
        self,
        message_type: type[Any],
        topic: str,
        qos: QoSProfile | int = qos_default,
        *,
        events: PublisherEvents | None = None,
    ) -> Publisher:
        """Publish messages of `message_type` on `topic`; a number for `qos` is the depth of the default profile.

        The type is a message class, or str, int, float, bool, bytes, dict or list for plain values.
        """
        return make_publisher(self, message_type, topic, as_qos(qos), events)

    def create_subscription(
        self,
        message_type: type[Any],
        topic: str,
        callback: Callable[..., Any],
        qos: QoSProfile | int = qos_default,
        *,
        raw: bool = False,
        dedicated: bool = False,
        events: SubscriptionEvents | None = None,
        group: CallbackGroup | None = None,
    ) -> Subscription:
        """Call `callback(message)` or `callback(message, info)` for each message, or plain value, on `topic`.

        `raw` gives the CDR bytes instead of a message; `dedicated` a thread of its own instead of the executor's.
        `group` says what the callback may overlap with on an executor of several threads.
        """
        options: Any = {"raw": raw, "dedicated": dedicated, "events": events, "group": group}
        return make_subscription(self, message_type, topic, callback, as_qos(qos), **options)

    def create_raw_publisher(
        self, topic: str, type_name: str, type_hash: str, qos: QoSProfile | int = qos_default
    ) -> RawPublisher:
        """Publish CDR bytes of a type that need not be known here."""
        return RawPublisher(self, topic, type_name, type_hash, as_qos(qos))

    def create_raw_subscription(
        self,
        topic: str,
        type_name: str,
        type_hash: str,
        qos: QoSProfile | int,
        sink: Callable[[zenoh.Sample], object],
    ) -> RawSubscription:
        """Hand each sample to `sink`, unread, on a Zenoh thread: it must be as cheap as a queue's put."""
        return RawSubscription(self, topic, type_name, type_hash, as_qos(qos), sink)

    # -- services --------------------------------------------------------------------------------------------------

    def create_service(
        self,
        service_type: type[Any],
        name: str,
        callback: Callable[..., Any],
        qos: QoSProfile | int = qos_services,
        *,
        backlog: int = LIMITS.service_backlog,
        group: CallbackGroup | None = None,
    ) -> Service:
        """Serve `name` with `callback(request, response)`, which fills in or returns the response.

        At most `backlog` requests wait for the executor; the depth of `qos` is only told to others.
        """
        coders = {"request": codec(service_type.Request), "response": codec(service_type.Response)}
        return Service(self, service_type, name, callback, qos=as_qos(qos), backlog=backlog, group=group, **coders)

    def create_client(self, service_type: type[Any], name: str, qos: QoSProfile | int = qos_services) -> Client:
        """Call the service `name`."""
        return make_client(self, service_type, name, qos)

    def create_raw_client(
        self, service: str, type_name: str, type_hash: str, qos: QoSProfile | int = qos_services
    ) -> RawClient:
        """Call a service in CDR bytes."""
        return RawClient(self, service, type_name, type_hash, as_qos(qos))

    # -- types of others -------------------------------------------------------------------------------------------

    def fetch_interface(self, type_name: str, type_hash: str = "", *, timeout_s: float = 5.0) -> type[Any]:
        """The class of a message, service or action by its name: the program's, else as a node of the graph tells it.

        `type_hash` chooses where several are in use; of an action it is that of its X_SendGoal. Waits up to
        `timeout_s` for somebody who uses the type, and for each that is asked, so not on the executor that would have
        to answer. `UnknownTypeError` says whom it asked and what came.
        """
        from metaros.node.introspection import fetch_interface

        return fetch_interface(self, type_name, type_hash, timeout_s=timeout_s)

    async def fetch_interface_async(self, type_name: str, type_hash: str = "", *, timeout_s: float = 5.0) -> type[Any]:
        """The same for coroutines."""
        from metaros.node.introspection import fetch_interface_async

        return await fetch_interface_async(self, type_name, type_hash, timeout_s=timeout_s)

    # -- parameters ------------------------------------------------------------------------------------------------

    def declare_parameter(self, name: str, default: object = None, **rules: Any) -> Any:
        """Add a parameter, return its value; the rules are those of `NodeParameters.declare`."""
        return self.parameters.declare(name, default, **rules)

    def create_parameter_client(self, node_name: str) -> ParameterClient:
        """Read and set the parameters of another node."""
        from metaros.node.parameters import ParameterClient

        return ParameterClient(self, node_name)

    # -- actions ---------------------------------------------------------------------------------------------------

    def create_action_server(
        self, action: type[Any], name: str, execute: Callable[[ServerGoal], Any], **options: Any
    ) -> ActionServer:
        """Run `execute(goal)` for the goals of `name`; `ActionServer` tells the options, such as `cancel=`."""
        from metaros.node.action import ActionServer

        return ActionServer(self, action, name, execute, **options)

    def create_action_client(self, action: type[Any], name: str) -> ActionClient:
        """Send goals to the action server `name`."""
        from metaros.node.action import ActionClient

        return ActionClient(self, action, name)

    # -- decorators ------------------------------------------------------------------------------------------------

    def subscription(
        self,
        message_type: type[Any],
        topic: str,
        *,
        qos: QoSProfile | int = qos_default,
        raw: bool = False,
        dedicated: bool = False,
        events: SubscriptionEvents | None = None,
        group: CallbackGroup | None = None,
    ) -> Callable[[F], F]:
        """`create_subscription` as a decorator of the callback."""

        def decorate(callback: F) -> F:
            options: Any = {"raw": raw, "dedicated": dedicated, "events": events, "group": group}
            self.create_subscription(message_type, topic, callback, qos, **options)
            return callback

        return decorate

    def timer(self, period_s: float, *, group: CallbackGroup | None = None) -> Callable[[F], F]:
        """`create_timer` as a decorator of the callback."""

        def decorate(callback: F) -> F:
            self.create_timer(period_s, callback, group=group)
            return callback

        return decorate

    def service(
        self,
        service_type: type[Any],
        name: str,
        *,
        qos: QoSProfile | int = qos_services,
        group: CallbackGroup | None = None,
    ) -> Callable[[F], F]:
        """`create_service` as a decorator of the callback."""

        def decorate(callback: F) -> F:
            self.create_service(service_type, name, callback, qos, group=group)
            return callback

        return decorate

    # -- life ------------------------------------------------------------------------------------------------------

    def close(self) -> None:
        """Close every endpoint and leave the graph. Safe to call twice."""
        heartbeat.leave(self)
        super().close()

    def __enter__(self) -> Node:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _rosout(self, qos: QoSProfile = qos_rosout) -> Callable[..., None]:
        log = message_class("rcl_interfaces/msg/Log")
        time = message_class("builtin_interfaces/msg/Time")
        publisher = Publisher(self, log, "/rosout", codec(log), qos)

        def publish(*, stamp_ns: int, **fields: Any) -> None:
            seconds, nanoseconds = divmod(stamp_ns, 1_000_000_000)
            with suppress(UsageError):  # a closed node still logs to stderr
                publisher.publish(log(stamp=time(sec=seconds, nanosec=nanoseconds), **fields))

        return publish

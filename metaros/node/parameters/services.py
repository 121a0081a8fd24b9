"""The six parameter services of a node and its /parameter_events, as any ROS 2 node offers them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from metaros.cdr import codec
from metaros.errors import ClosedError
from metaros.node.core import NodeCore
from metaros.node.parameters.node_parameters import NodeParameters
from metaros.node.parameters.store import Change
from metaros.node.publisher import RawPublisher
from metaros.node.standard_services import StandardService, serve
from metaros.wire import qos_parameters

__all__ = ["EVENTS", "EVENT_HASH", "EVENT_TYPE", "SERVICES", "offer_parameters"]

EVENTS: Final = "/parameter_events"
EVENT_TYPE: Final = "rcl_interfaces/msg/ParameterEvent"
EVENT_HASH: Final = "RIHS01_043e627780fcad87a22d225bc2a037361dba713fca6a6b9f4b869a5aa0393204"
SERVICES: Final = (
    StandardService(
        "describe_parameters",
        "rcl_interfaces/srv/DescribeParameters",
        "RIHS01_845b484d71eb0673dae682f2e3ba3c4851a65a3dcfb97bddd82c5b57e91e4cff",
    ),
    StandardService(
        "get_parameter_types",
        "rcl_interfaces/srv/GetParameterTypes",
        "RIHS01_da199c878688b3e530bdfe3ca8f74cb9fa0c303101e980a9e8f260e25e1c80ca",
    ),
    StandardService(
        "get_parameters",
        "rcl_interfaces/srv/GetParameters",
        "RIHS01_bf9803d5c74cf989a5de3e0c2e99444599a627c7ff75f97b8c05b01003675cbc",
    ),
    StandardService(
        "list_parameters",
        "rcl_interfaces/srv/ListParameters",
        "RIHS01_3e6062bfbb27bfb8730d4cef2558221f51a11646d78e7bb30a1e83afac3aad9d",
    ),
    StandardService(
        "set_parameters",
        "rcl_interfaces/srv/SetParameters",
        "RIHS01_56eed9a67e169f9cb6c1f987bc88f868c14a8fc9f743a263bc734c154015d7e0",
    ),
    StandardService(
        "set_parameters_atomically",
        "rcl_interfaces/srv/SetParametersAtomically",
        "RIHS01_0e192ef259c07fc3c07a13191d27002222e65e00ccec653ca05e856f79285fcd",
    ),
)


def offer_parameters(node: NodeCore, parameters: NodeParameters) -> None:
    """Serve the node's parameters, and publish what happens to them from now on."""
    publisher = RawPublisher(node, EVENTS, EVENT_TYPE, EVENT_HASH, qos_parameters)

    def notify(changes: Sequence[Change]) -> None:
        from metaros.node.parameters.wire import event_message

        event = event_message(node.full_name, changes, node.clock.wall_ns())
        try:
            publisher.publish(codec(EVENT_TYPE).encode(event))
        except ClosedError:  # the parameters of a closed node are its own affair
            return

    parameters.notify = notify
    answers = _ParameterServices(parameters)
    for service in SERVICES:
        serve(node, service, getattr(answers, service.name), qos_parameters)


class _ParameterServices:
    """One method a service, `(request, response)` in rcl_interfaces terms."""

    def __init__(self, parameters: NodeParameters) -> None:
        self._parameters = parameters
        self._store = parameters.store

    def describe_parameters(self, request: Any, response: Any) -> None:
        """An unknown name gets the empty descriptor."""
        from metaros.node.parameters.wire import descriptor_message

        response.descriptors = [descriptor_message(self._store.entry(name)) for name in request.names]

    def get_parameter_types(self, request: Any, response: Any) -> None:
        """An unknown name is NOT_SET."""
        entries = [self._store.entry(name) for name in request.names]
        response.types = [0 if entry is None else int(entry.kind) for entry in entries]

    def get_parameters(self, request: Any, response: Any) -> None:
        """An unknown name is NOT_SET."""
        from metaros.node.parameters.wire import value_message

        entries = [self._store.entry(name) for name in request.names]
        response.values = [value_message(e.value, e.kind) if e is not None else value_message(None) for e in entries]

    def list_parameters(self, request: Any, response: Any) -> None:
        """Names below the prefixes, and the groups they are in."""
        names, prefixes = self._store.list(request.prefixes, request.depth)
        response.result.names, response.result.prefixes = names, prefixes

    def set_parameters(self, request: Any, response: Any) -> None:
        """Each for itself, in order."""
        for parameter in request.parameters:
            response.results.append(self._result([parameter]))

    def set_parameters_atomically(self, request: Any, response: Any) -> None:
        """All or none."""
        response.result = self._result(request.parameters)

    def _result(self, parameters: Sequence[Any]) -> Any:
        from metaros.interfaces.rcl_interfaces.msg import SetParametersResult
        from metaros.node.parameters.wire import read_value

        values = {parameter.name: read_value(parameter.value) for parameter in parameters}
        outcome = self._parameters.try_set(values, exact=True)
        return SetParametersResult(successful=outcome.successful, reason=outcome.reason)

"""The broker: a hub for ZeroMQ programs, bridged to the topics of one ROS domain."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field

from metaros.broker.bridge import Bridge
from metaros.broker.hub import Hub, HubOptions
from metaros.broker.report import BrokerReport
from metaros.broker.type_inference import TypeTable
from metaros.executor import SingleThreadedExecutor
from metaros.idl.globs import Glob
from metaros.node import Context, Node

__all__ = ["Broker", "BrokerOptions"]


@dataclass(frozen=True, slots=True, kw_only=True)
class BrokerOptions:
    """`only` restricts the bridge to some topics; the hub forwards all the same.

    `two_frames` sends topic and payload to ZeroMQ subscribers as two frames instead of the one of `metaros` 1.x;
    `strict_json` writes null where a number is not finite, which Python reads otherwise but other languages do not.
    """

    hub: HubOptions = field(default_factory=HubOptions)
    types: TypeTable = field(default_factory=TypeTable)
    only: tuple[Glob, ...] = ()
    two_frames: bool = False
    strict_json: bool = False


class Broker:
    """Runs from its making until `close`; a context manager. ConfigError where an endpoint cannot be bound."""

    def __init__(self, context: Context, options: BrokerOptions | None = None) -> None:
        options = BrokerOptions() if options is None else options
        self._hub = Hub(options.hub)
        try:
            self._node = Node("zmq_broker", context=context)
        except BaseException:
            self._hub.close()
            raise
        self._bridge = Bridge(
            self._hub,
            self._node,
            table=options.types,
            only=options.only,
            two_frames=options.two_frames,
            strict=options.strict_json,
        )
        # the node's own services: its parameters, and the descriptions of the types that it publishes
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._executor.spin, name="metaros-zmq-node", daemon=True)
        self._thread.start()

    def report(self) -> BrokerReport:
        """What went through since the beginning."""
        return self._bridge.report()

    def close(self) -> None:
        """Stop the bridge, leave the graph, stop the hub."""
        self._bridge.close()
        self._executor.shutdown()
        self._thread.join()
        self._node.close()
        self._hub.close()

    def __enter__(self) -> Broker:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

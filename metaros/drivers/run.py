"""Run one driver until it is asked to end. `python -m metaros.drivers.run KIND` is how a table of nodes starts one."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Mapping
from typing import Any, Final

from metaros.concurrency.signals import StopEvent, stop_signals
from metaros.drivers.context import Device, DriverContext
from metaros.drivers.manifest import Manifest
from metaros.drivers.node import DriverNode
from metaros.drivers.registry import device_maker, manifest_of
from metaros.errors import ConfigError
from metaros.executor import SingleThreadedExecutor
from metaros.node import Context, heartbeat
from metaros.node.context import shared_context

__all__ = ["main", "run_device", "run_driver"]

_LOOK_S: Final = 0.2


def run_driver(
    kind: str,
    parameters: Mapping[str, Any],
    *,
    context: Context,
    namespace: str = "/",
    name: str = "",
    stop: threading.Event | None = None,
) -> None:
    """Run a driver until `stop` is set, Ctrl-C, or the context's close. Values may be texts.

    Raises:
        ConfigError: no such kind, a parameter it does not have or cannot use, or a library that is not installed.
    """
    run_device(
        manifest_of(kind),
        device_maker(kind),
        parameters,
        context=context,
        namespace=namespace,
        name=name,
        stop=threading.Event() if stop is None else stop,
    )


def run_device(
    manifest: Manifest,
    make: Callable[[DriverContext], Device],
    parameters: Mapping[str, Any],
    *,
    context: Context,
    namespace: str = "/",
    name: str = "",
    stop: threading.Event,
) -> None:
    """The same for any manifest and its `make`, such as those of a folder outside this package."""
    node = DriverNode(manifest, make, parameters, context=context, namespace=namespace, name=name)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    heartbeat.follow(node)
    try:
        node.start()
        while not stop.is_set() and not node.ended and not node.closed:
            executor.spin_once(_LOOK_S)
        if node.ended and node.status.state == "failed":
            raise ConfigError(node.status.detail)
    except KeyboardInterrupt:
        pass
    finally:
        heartbeat.leave(node)
        node.stop()
        executor.shutdown()


def main() -> None:
    """`KIND`, with parameters, name and namespace as `--ros-args`, on the machine's router."""
    if len(sys.argv) != 2:
        raise ConfigError("expected the kind of a driver, such as camera")
    stop = StopEvent()
    for number in stop_signals():
        signal.signal(number, lambda *_: stop.set())
    context = shared_context()
    try:
        run_driver(sys.argv[1], {}, context=context, stop=stop)
    finally:
        context.close()


if __name__ == "__main__":
    main()

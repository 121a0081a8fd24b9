"""The table of drivers, and the one way to start one."""

from __future__ import annotations

import importlib
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from metaros.errors import ConfigError
from metaros.node import Context

__all__ = ["DRIVERS", "Driver", "driver_kinds", "run_driver"]

Run = Callable[[Context, str, Mapping[str, str], threading.Event], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Driver:
    """A kind of driver: its package has a manifest.toml and a `node` module with a `run`.

    `run(context, namespace, params, stop)` returns soon after `stop` is set, Ctrl-C, or the context's close.
    """

    kind: str
    package: str
    summary: str


DRIVERS: tuple[Driver, ...] = (
    Driver(kind="camera", package="metaros.drivers.camera", summary="A camera, file, stream or test pattern as JPEG."),
)


def driver_kinds() -> tuple[str, ...]:
    """The kinds there are."""
    return tuple(driver.kind for driver in DRIVERS)


def run_driver(
    kind: str,
    params: Mapping[str, str],
    *,
    context: Context,
    namespace: str = "/",
    stop: threading.Event | None = None,
) -> None:
    """Run a driver until `stop` is set, Ctrl-C, or the context's close.

    Raises:
        ConfigError: no such kind, or a parameter it does not have or cannot use.
    """
    for driver in DRIVERS:
        if driver.kind == kind:
            run: Run = importlib.import_module(f"{driver.package}.node").run
            run(context, namespace, params, threading.Event() if stop is None else stop)
            return
    raise ConfigError(f"no driver {kind!r}; there are {', '.join(driver_kinds())}")

"""A driver until it is asked to end, and what ends it by itself."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

import pytest

import metaros
from metaros.drivers import run_driver
from metaros.drivers.context import DriverContext
from metaros.drivers.manifest import read_manifest
from metaros.drivers.run import run_device
from metaros.errors import ClosedError, ConfigError
from tests.support.waiting import wait_until

HEAD = 'kind = "toy"\nname = "Toy"\nsummary = "Toys."\nquality = "bronze"\nstale_after_s = 0.0\n'


class Toy:
    """Calls `opened`, then waits."""

    def __init__(self, context: DriverContext, opened: Callable[[], object]) -> None:
        self._context = context
        self._opened = opened

    def open(self) -> None:
        """Tell the test, which may raise."""
        self._opened()

    def run(self) -> None:
        """Wait until told to stop."""
        while not self._context.wait(1.0):
            pass

    def close(self) -> None:
        """There is nothing to let go."""


def run(folder: Path, context: metaros.Context, opened: Callable[[], object], stop: threading.Event) -> None:
    path = folder / "toy" / "manifest.toml"
    path.parent.mkdir()
    path.write_text(HEAD)
    run_device(read_manifest(path), lambda context: Toy(context, opened), {}, context=context, stop=stop)


def test_it_runs_until_stop_is_set(tmp_path: Path, context: metaros.Context) -> None:
    opened, stop = threading.Event(), threading.Event()
    thread = threading.Thread(target=run, args=(tmp_path, context, opened.set, stop))
    thread.start()
    wait_until(opened.is_set)
    stop.set()
    thread.join(60)
    assert not thread.is_alive()
    assert not [other for other in threading.enumerate() if other.name == "driver toy"]


def test_a_configuration_that_cannot_work_is_raised(tmp_path: Path, context: metaros.Context) -> None:
    def opened() -> None:
        raise ConfigError("no such port can be")

    with pytest.raises(ConfigError, match="no such port can be"):
        run(tmp_path, context, opened, threading.Event())


def test_a_closed_context_ends_it(tmp_path: Path, context: metaros.Context) -> None:
    def opened() -> None:
        raise ClosedError("the context is closed")

    run(tmp_path, context, opened, threading.Event())


def test_a_wrong_parameter_is_raised_before_the_graph_is_asked(context: metaros.Context) -> None:
    with pytest.raises(ConfigError, match="rate_hz must be"):
        run_driver("host_metrics", {"rate_hz": "99"}, context=context)

"""The lifecycle node around a device: opened again and again, whatever the device does."""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import metaros
from metaros.drivers import node as node_module
from metaros.drivers.backoff import Backoff
from metaros.drivers.context import DriverContext
from metaros.drivers.manifest import Manifest, read_manifest
from metaros.drivers.node import DriverNode
from metaros.errors import ClosedError, ConfigError, UnavailableError
from metaros.interfaces.std_msgs.msg import Int32
from tests.support.waiting import wait_until

MANIFEST = """
kind = "toy"
name = "Toy"
summary = "Counts."
quality = "bronze"
[[parameters]]
name = "step"
type = "integer"
default = 1
minimum = 1
maximum = 9
live = true
summary = "How far."
"""


class Toy:
    """Publishes numbers; `failures` are raised by `open`, one after the other."""

    def __init__(self, context: DriverContext) -> None:
        self.context = context
        self.publisher = context.publisher(Int32, "count")
        self.failures: list[Exception] = []
        self.close_fails = False
        self.run_returns = False
        self.opened = self.closed = 0
        self.hang = threading.Event()
        self.hang.set()
        self.steps: list[int] = []
        context.on_change("step", self.steps.append)

    def open(self) -> None:
        """Fail, or be there."""
        self.opened += 1
        if self.failures:
            raise self.failures.pop(0)
        self.context.opened("here")

    def run(self) -> None:
        """Count until told to stop."""
        while not self.run_returns and not self.context.wait(0.01):
            self.publisher.publish(Int32(data=self.opened))
            self.hang.wait(60)

    def close(self) -> None:
        """Count, and fail where asked."""
        self.closed += 1
        if self.close_fails:
            raise RuntimeError("close fails")


class Rig:
    """A toy driver and its toy."""

    def __init__(self, manifest: Manifest, context: metaros.Context, parameters: dict[str, object]) -> None:
        self.toys: list[Toy] = []
        backoff = Backoff(first_s=0.02, last_s=0.02)
        self.node = DriverNode(manifest, self.make, parameters, context=context, backoff=backoff)

    def make(self, context: DriverContext) -> Toy:
        """Refuse a step of 9, else a new toy."""
        if context["step"] == 9:
            raise ConfigError("toy: nine is too far")
        self.toys.append(Toy(context))
        return self.toys[-1]

    @property
    def toy(self) -> Toy:
        """The newest."""
        return self.toys[-1]

    @property
    def state(self) -> str:
        """Of its standing."""
        return self.node.status.state.value


@pytest.fixture
def manifest(tmp_path: Path) -> Manifest:
    folder = tmp_path / "toy"
    folder.mkdir()
    (folder / "manifest.toml").write_text(MANIFEST)
    return read_manifest(folder / "manifest.toml")


@contextmanager
def rig(manifest: Manifest, context: metaros.Context, **parameters: object) -> Iterator[Rig]:
    made = Rig(manifest, context, parameters)
    try:
        yield made
    finally:
        made.node.stop()


def test_a_device_that_is_away_is_tried_until_it_is_there(manifest: Manifest, context: metaros.Context) -> None:
    with rig(manifest, context) as toy:
        assert toy.node.trigger("configure")
        toy.toy.failures = [UnavailableError("away"), UnavailableError("away")]
        assert toy.node.trigger("activate")
        wait_until(lambda: toy.state == "working" and toy.node.status.counters["readings"] > 3)
        assert toy.toy.opened == 3
        assert toy.node.status.counters["reconnects"] == 2
        assert toy.node.trigger("deactivate")
        assert toy.state == "resting"
        assert toy.toy.closed == 3


def test_a_foreign_error_is_logged_once_and_tried_again(
    manifest: Manifest, context: metaros.Context, caplog: pytest.LogCaptureFixture
) -> None:
    with rig(manifest, context) as toy, caplog.at_level(logging.ERROR, "metaros.drivers"):
        assert toy.node.trigger("configure")
        toy.toy.failures = [KeyError("x"), KeyError("x"), KeyError("x")]
        assert toy.node.trigger("activate")
        wait_until(lambda: toy.state == "working")
    assert [record.message for record in caplog.records] == ["/toy: the driver failed"]


def test_a_close_that_raises_ends_nothing(manifest: Manifest, context: metaros.Context) -> None:
    with rig(manifest, context) as toy:
        assert toy.node.trigger("configure")
        toy.toy.close_fails = True
        toy.toy.failures = [UnavailableError("away")]
        assert toy.node.trigger("activate")
        wait_until(lambda: toy.state == "working")
        assert toy.node.trigger("deactivate")


def test_a_device_that_ends_by_itself_is_opened_again_after_a_wait(
    manifest: Manifest, context: metaros.Context
) -> None:
    with rig(manifest, context) as toy:
        assert toy.node.trigger("configure")
        toy.toy.run_returns = True
        assert toy.node.trigger("activate")
        wait_until(lambda: toy.node.status.detail == "the device ended")
        toy.toy.run_returns = False
        wait_until(lambda: toy.state == "working")
        assert toy.toy.opened < 50


def test_it_goes_through_its_life_again_and_again(manifest: Manifest, context: metaros.Context) -> None:
    with rig(manifest, context) as toy:
        for _ in range(5):
            for transition in ("configure", "activate", "deactivate", "cleanup"):
                assert toy.node.trigger(transition)
        assert len(toy.toys) == 5
        assert not [thread for thread in threading.enumerate() if thread.name == "driver toy"]


def test_a_device_that_does_not_let_go_is_not_run_twice(
    manifest: Manifest, context: metaros.Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(node_module, "CLOSE_S", 0.05)
    with rig(manifest, context) as toy:
        toy.node.start()
        toy.toy.hang.clear()
        wait_until(lambda: toy.node.status.counters["readings"] > 0)
        assert not toy.node._halt()
        assert not toy.node.on_activate()
        toy.toy.hang.set()
        wait_until(toy.node._halt)
        assert toy.node.on_activate()


def test_a_configuration_that_cannot_work_is_refused(manifest: Manifest, context: metaros.Context) -> None:
    with rig(manifest, context, step=9) as toy:
        with pytest.raises(ConfigError, match="nine is too far"):
            toy.node.start()
        assert toy.state == "failed"


def test_a_configuration_error_on_the_thread_ends_the_driver(manifest: Manifest, context: metaros.Context) -> None:
    with rig(manifest, context) as toy:
        assert toy.node.trigger("configure")
        toy.toy.failures = [ConfigError("no such port can be")]
        assert toy.node.trigger("activate")
        wait_until(lambda: toy.node.ended)
        assert toy.state == "failed"
        assert toy.node.status.detail == "no such port can be"


def test_a_closed_context_ends_the_driver(manifest: Manifest, context: metaros.Context) -> None:
    with rig(manifest, context) as toy:
        assert toy.node.trigger("configure")
        toy.toy.failures = [ClosedError("closed")]
        assert toy.node.trigger("activate")
        wait_until(lambda: toy.node.ended)


def test_an_unplug_is_simulated(manifest: Manifest, context: metaros.Context) -> None:
    with rig(manifest, context) as toy:
        toy.node.start()
        wait_until(lambda: toy.state == "working")
        toy.node.faults.inject("unplug")
        wait_until(lambda: toy.state == "waiting")
        assert toy.node.status.detail == "unplugged (simulated)"
        toy.node.faults.inject("clear")
        wait_until(lambda: toy.state == "working")


def test_a_live_parameter_reaches_the_device(manifest: Manifest, context: metaros.Context) -> None:
    with rig(manifest, context) as toy:
        toy.node.start()
        toy.node.parameters["step"] = 4
        assert toy.toy.steps == [4]

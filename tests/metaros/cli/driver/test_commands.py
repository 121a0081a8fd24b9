"""`metaros driver`: what there is, what is plugged in, and a driver of one's own, run."""

from __future__ import annotations

import json
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import metaros
from metaros.interfaces.metaros_msgs.msg import HostMemory
from metaros.interfaces.std_msgs.msg import Float64
from tests.metaros.cli.conftest import spinning
from tests.support.devices.pty_device import PtyDevice
from tests.support.processes.command_line import Done, call_metaros, program, stop_metaros
from tests.support.processes.processes import END_S, started
from tests.support.waiting import wait_until

Listening = Callable[[type, str], list[Any]]


def driver(*arguments: str) -> Done:
    return call_metaros("driver", *arguments)


@pytest.fixture
def listening(zenoh_router: str) -> Iterator[Listening]:
    """`listening(Float64, "/topic")` is the list of what is heard there."""
    with metaros.Context(connect=zenoh_router) as context, metaros.Node("viewer", context=context) as viewer:
        with spinning(viewer):

            def listen(kind: type, topic: str) -> list[Any]:
                received: list[Any] = []
                viewer.create_subscription(kind, topic, received.append, metaros.qos_sensor_data)
                return received

            yield listen


def test_the_list_says_what_is_missing_here() -> None:
    rows = json.loads(driver("list", "-o", "json").out)
    ld19 = next(row for row in rows if row["kind"] == "ld19")
    assert (ld19["quality"], ld19["missing"]) == ("silver", [])
    assert "ld19" in driver("list").out


def test_info_shows_topics_and_parameters() -> None:
    text = driver("info", "ld19").out
    for word in ("LaserScan", "range_max_m", "12.0", "byte-true emulator"):
        assert word in text
    assert json.loads(driver("info", "ld19", "-o", "json").out)["kind"] == "ld19"


def test_probe_tells_commands_and_refuses_unknown_kinds() -> None:
    for found in json.loads(driver("probe", "-o", "json").out):
        assert found["command"].startswith(f"metaros driver run {found['kind']}")
    done = driver("probe", "toaster")
    assert (done.code, "no driver 'toaster'" in done.err) == (2, True)


def test_what_is_wrong_is_said_before_anything_is_asked() -> None:
    for arguments, said in (
        (("toaster",), "no driver 'toaster'; there are"),
        (("ld19", "-p", "port"), "is not NAME=VALUE"),
        (("ld19", "-p", "prot=x"), "did you mean 'port'"),
        (("ld19", "-p", "bins=1"), "must be 36 to 3600"),
        (("./nowhere",), "manifest.toml"),
    ):
        done = driver("run", *arguments, "--zenoh-port", "1")
        assert done.code == 2, done.err
        assert said in done.err


def test_a_driver_runs_under_its_name_until_ctrl_c(zenoh_port: str, listening: Listening) -> None:
    memory = listening(HostMemory, "/r1/host/memory")
    options = ["-p", "rate_hz=10", "--namespace", "/r1", "--name", "computer", "--zenoh-port", zenoh_port]
    with started(program("driver", "run", "host_metrics", *options)) as process:
        wait_until(lambda: len(memory) > 2 or process.poll() is not None)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=END_S)
    assert (process.returncode, len(memory) > 2) == (0, True), err


def test_a_new_driver_runs_from_its_folder(zenoh_port: str, listening: Listening, tmp_path: Path) -> None:
    made = driver("new", "sonar_toy", "--directory", str(tmp_path))
    assert made.code == 0
    assert "metaros driver run" in made.out
    values = listening(Float64, "/sonar_toy/value")
    with PtyDevice(tmp_path) as device:

        def received(_: str) -> bool:
            device.write(b"4.5\n")
            return bool(values)

        options = ["-p", f"port={device.path}", "--zenoh-port", zenoh_port]
        assert stop_metaros("driver", "run", str(tmp_path / "sonar_toy"), *options, when=received).code == 0
    assert values[0].data == 4.5

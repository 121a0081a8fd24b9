"""What systemd hears of the gateway: ready, alive, ending; and nothing where it did not ask."""

from __future__ import annotations

import asyncio
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from gateway.systemd import BEAT, ENDING, READY, beat, tell_systemd
from tests.support.processes import END_S, started

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="there is no systemd")


@pytest.fixture
def hearing(tmp_path: Path) -> Iterator[tuple[socket.socket, str]]:
    """systemd's end of the socket, and its address."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as ear:
        ear.bind(str(tmp_path / "notify"))
        ear.settimeout(60)
        yield ear, str(tmp_path / "notify")


def test_a_word_is_heard(hearing: tuple[socket.socket, str]) -> None:
    ear, address = hearing
    assert tell_systemd(READY, {"NOTIFY_SOCKET": address})
    assert ear.recv(100) == b"READY=1"


@pytest.mark.skipif(sys.platform != "linux", reason="names without a file are Linux's")
def test_a_name_without_a_file_is_called_too() -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as ear:
        ear.bind("")  # the kernel gives it such a name
        address = ear.getsockname().decode().replace("\0", "@")
        assert tell_systemd(READY, {"NOTIFY_SOCKET": address})
        assert ear.recv(100) == b"READY=1"


@pytest.mark.parametrize("address", ["", "notify", "vsock:2:1", "/nowhere/notify"])
def test_who_does_not_ask_or_is_gone_is_told_nothing(address: str) -> None:
    assert not tell_systemd(READY, {"NOTIFY_SOCKET": address})


@pytest.mark.parametrize("asked", [{}, {"WATCHDOG_USEC": "soon"}, {"WATCHDOG_USEC": "0"}])
async def test_without_a_watchdog_there_are_no_beats(asked: dict[str, str]) -> None:
    await asyncio.wait_for(beat(asked), 60)


async def test_a_watchdog_of_another_process_is_not_fed(hearing: tuple[socket.socket, str]) -> None:
    asked = {"NOTIFY_SOCKET": hearing[1], "WATCHDOG_USEC": "3000", "WATCHDOG_PID": str(os.getpid() + 1)}
    await asyncio.wait_for(beat(asked), 60)


async def test_a_gone_listener_does_not_end_the_beats(hearing: tuple[socket.socket, str], tmp_path: Path) -> None:
    task = asyncio.create_task(beat({"NOTIFY_SOCKET": str(tmp_path / "none"), "WATCHDOG_USEC": "3000"}))
    await asyncio.sleep(0.05)
    assert not task.done()
    task.cancel()


def test_a_gateway_is_ready_beats_and_ends(hearing: tuple[socket.socket, str], tmp_path: Path) -> None:
    ear, address = hearing
    ports = ["--port", "0", "--grpc-port", "0", "--api-grpc-port", "0", "--foxglove-port", "off"]
    command = [sys.executable, "-m", "metaros", "gateway", "--data-dir", str(tmp_path / "data"), *ports]
    environment = {**os.environ, "NOTIFY_SOCKET": address, "WATCHDOG_USEC": "300000", "HOME": str(tmp_path)}
    with started([*command, "--rosbridge-port", "off"], env=environment, stderr=subprocess.STDOUT) as process:
        heard = [ear.recv(100).decode()]
        while READY not in heard or heard[-1] != BEAT:
            heard.append(ear.recv(100).decode())
        process.send_signal(signal.SIGTERM)
        while heard[-1] != ENDING:
            heard.append(ear.recv(100).decode())
        assert process.wait(END_S) == 0
    assert heard.count(READY) == heard.count(ENDING) == 1
    assert set(heard) == {READY, BEAT, ENDING}

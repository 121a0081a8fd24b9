"""What systemd hears of the gateway: ready, alive, ending; and nothing where it did not ask."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from gateway.server.systemd import BEAT, ENDING, READY, notify_systemd, watchdog_loop
from tests.support.processes.command_line import program
from tests.support.processes.processes import END_S, started

PORTS = [f"--{name}-port=0" for name in ("grpc", "api-grpc")] + [
    "--port=0",
    "--foxglove-port=off",
    "--rosbridge-port=off",
]
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="there is no systemd")


@pytest.fixture
def hearing(tmp_path: Path) -> Iterator[tuple[socket.socket, str]]:
    """systemd's end of the socket, and its address."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as ear:
        ear.bind(str(tmp_path / "notify"))
        ear.settimeout(60)
        yield ear, str(tmp_path / "notify")


def test_a_word_is_received(hearing: tuple[socket.socket, str]) -> None:
    ear, address = hearing
    assert notify_systemd(READY, {"NOTIFY_SOCKET": address})
    assert ear.recv(100) == b"READY=1"


@pytest.mark.skipif(sys.platform != "linux", reason="names without a file are Linux's")
def test_a_name_without_a_file_is_called_too() -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as ear:
        ear.bind("")  # the kernel gives it such a name
        address = ear.getsockname().decode().replace("\0", "@")
        assert notify_systemd(READY, {"NOTIFY_SOCKET": address})
        assert ear.recv(100) == b"READY=1"


@pytest.mark.parametrize("address", ["", "notify", "vsock:2:1", "/nowhere/notify"])
def test_who_does_not_ask_or_is_gone_is_reported_nothing(address: str) -> None:
    assert not notify_systemd(READY, {"NOTIFY_SOCKET": address})


@pytest.mark.parametrize("asked", [{}, {"WATCHDOG_USEC": "soon"}, {"WATCHDOG_USEC": "0"}])
async def test_without_a_watchdog_there_are_no_beats(asked: dict[str, str]) -> None:
    await asyncio.wait_for(watchdog_loop(asked), 60)


async def test_a_watchdog_of_another_process_is_not_fed(hearing: tuple[socket.socket, str]) -> None:
    asked = {"NOTIFY_SOCKET": hearing[1], "WATCHDOG_USEC": "3000", "WATCHDOG_PID": str(os.getpid() + 1)}
    await asyncio.wait_for(watchdog_loop(asked), 60)


async def test_a_gone_listener_does_not_end_the_beats(tmp_path: Path) -> None:
    address = str(tmp_path / "notify")
    task = asyncio.create_task(watchdog_loop({"NOTIFY_SOCKET": address, "WATCHDOG_USEC": "3000"}))
    await asyncio.sleep(0)  # the first one, which nobody hears
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as ear:
        ear.bind(address)
        ear.setblocking(False)
        async with asyncio.timeout(60):
            assert await asyncio.get_running_loop().sock_recv(ear, 100) == BEAT.encode()
    task.cancel()


def received_until(ear: socket.socket, word: str) -> list[str]:
    """What is said up to that word."""
    received = [ear.recv(100).decode()]
    while received[-1] != word:
        received.append(ear.recv(100).decode())
    return received


@pytest.mark.integration
def test_a_gateway_that_was_killed_is_started_again_is_ready_beats_and_ends(
    hearing: tuple[socket.socket, str], tmp_path: Path
) -> None:
    ear, address = hearing
    data, status = tmp_path / "data", tmp_path / "status.json"
    command = program("gateway", "--data-dir", str(data), "--status-file", str(status), *PORTS)
    environment = {**os.environ, "NOTIFY_SOCKET": address, "WATCHDOG_USEC": "300000", "HOME": str(tmp_path)}
    with started(command, env=environment, stderr=subprocess.STDOUT) as killed:
        received_until(ear, READY)
        killed.kill()
        killed.communicate()
    status.unlink()
    ear.setblocking(False)
    with suppress(BlockingIOError):
        while ear.recv(100):  # it may have beaten
            pass
    ear.settimeout(60)
    with started(command, env=environment, stderr=subprocess.STDOUT) as process:
        received = received_until(ear, READY) + received_until(ear, BEAT)
        said = json.loads(status.read_text())
        assert (said["ready"], said["pid"]) == (True, process.pid)
        process.send_signal(signal.SIGTERM)
        received += received_until(ear, ENDING)
        output, _ = process.communicate(timeout=END_S)
    assert process.returncode == 0
    assert received.count(READY) == received.count(ENDING) == 1
    assert set(received) == {READY, BEAT, ENDING}
    assert output.startswith(f"gateway ready: {said['url']}\n  robots 127.0.0.1:{said['grpc_port']}")
    assert len(output.splitlines()) == 3

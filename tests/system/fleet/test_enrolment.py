"""The two commands of docs/howto/enrol_a_robot.md as processes, and the agent that then needs no gateway's address."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.processes.stack import Stack
from tests.support.waiting import wait_until


def metaros(command: str, **environ: str) -> str:
    """What a command prints."""
    words = [sys.executable, "-m", *shlex.split(command)]
    done = subprocess.run(
        words, capture_output=True, text=True, stdin=subprocess.DEVNULL, env={**os.environ, **environ}, timeout=120
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.integration
def test_two_commands_make_a_robot_that_nobody_else_can_be(
    shared_gateway: Stack, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    with shared_gateway.beside(tmp_path) as stack:
        zenoh = ("--zenoh-profile", "protected", "--zenoh-credentials", str(tmp_path / "zenoh"))
        stack.start("router", "router", "--port", str(stack.zenoh_port), *zenoh)
        reported = metaros(f"metaros robot token --robot arm_1 --gateway {stack.url}", METAROS_KEY=stack.key)
        command = next(line for line in reported.splitlines() if line.startswith("metaros agent enrol"))
        assert "enrolled arm_1" in metaros(command)
        port = ("--zenoh-port", str(stack.zenoh_port))
        agent = stack.start("agent", "agent", "--name", "arm_1", "--namespace", "/arm_1", *port, *zenoh)
        wait_until(lambda: "arm_1" in stack.online())
        wait_until(lambda: "link up" in agent.output)

        other = ("--state-dir", str(tmp_path / "other"), "--gateway", f"127.0.0.1:{stack.grpc_port}")
        thief = stack.start("thief", "agent", "--name", "arm_1", "--namespace", "/arm_1", *port, *zenoh, *other)
        wait_until(lambda: "not_enrolled" in thief.output)
        assert "link up" not in thief.output
        assert "arm_1" in stack.online()

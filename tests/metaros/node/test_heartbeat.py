"""A supervised process says that its nodes' executors work; in a process of its own, which has one sender."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

NODES = """
    import os, sys, threading
    import metaros

    assert "METAROS_HEARTBEAT" in os.environ
    with metaros.Context(connect=[]) as context:
        first = metaros.Node("first", context=context, use_sim_time=SIM)
        assert "METAROS_HEARTBEAT" not in os.environ  # it is not for the children of this process
        second = metaros.Node("second", context=context)  # nobody spins it: it is not missed
        thread = threading.Thread(target=lambda: metaros.spin(first))
        thread.start()
        sys.stdin.readline()
        first.close()
        thread.join()
        print("closed", flush=True)
        sys.stdin.readline()
"""


@contextmanager
def supervised(code: str) -> Iterator[tuple[socket.socket, subprocess.Popen[str]]]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ears:
        ears.bind(("127.0.0.1", 0))
        ears.settimeout(60)
        env = {**os.environ, "METAROS_HEARTBEAT": f"127.0.0.1:{ears.getsockname()[1]}:secret:0.02"}
        lines = "\n".join(line.removeprefix("    ") for line in code.splitlines())
        process = subprocess.Popen(
            [sys.executable, "-c", lines], env=env, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        with process:
            try:
                yield ears, process
            finally:
                process.kill()


@pytest.mark.parametrize("simulated", ["False", "True"])
def test_a_node_that_spins_beats_and_takes_its_leave(simulated: str) -> None:
    with supervised(NODES.replace("SIM", simulated)) as (ears, process):
        assert [ears.recv(64) for _ in range(3)] == [b"secret +1"] * 3
        assert process.stdin is not None
        process.stdin.write("\n")
        process.stdin.flush()
        words = {b"secret +1"}
        while b"secret -1" not in words:
            words.add(ears.recv(64))
        assert words == {b"secret +1", b"secret -1"}

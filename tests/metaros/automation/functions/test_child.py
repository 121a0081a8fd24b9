"""The keeper of a worker: it hears of every end, however the signal of it and its wait for it fall together."""

from __future__ import annotations

import subprocess
import sys

import pytest

from metaros.automation.functions.zygote import zygote_works

pytestmark = pytest.mark.skipif(not zygote_works(), reason="Linux")

KEEPER = """
import os, signal, socket
from metaros.automation.functions.child import SignalPipe

gateway, control = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
signals = SignalPipe()
worker = os.fork()
if worker == 0:
    signals.release()
    os.kill(os.getpid(), signal.SIGTERM)  # which ends it, as it would a program
os.waitid(os.P_PID, worker, os.WEXITED | os.WNOWAIT)
for _ in range(3):
    pass  # between two steps of the interpreter the handler runs: all of that before the wait begins
signals.wait(worker, control)
print(gateway.recv(100).decode())

stays = os.fork()
if stays == 0:
    gateway.close()
    signals.release()
    signal.pause()
os.kill(os.getpid(), signal.SIGTERM)
signals.wait(stays, control)
print("told to end")
gateway.close()
signals.wait(stays, control)
print("let go")
os.kill(stays, signal.SIGKILL)
"""


def test_what_happens_just_before_the_wait_ends_it_too() -> None:
    done = subprocess.run([sys.executable, "-c", KEEPER], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.splitlines() == ['{"status": -15}', "told to end", "let go"]

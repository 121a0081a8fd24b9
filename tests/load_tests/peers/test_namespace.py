"""A network of one's own, where the system grants it."""

from __future__ import annotations

import subprocess
import sys

import pytest

SCRIPT = """
import socket
from load_tests.peers.measure import loopback_bytes
from load_tests.peers.namespace import own_network
if own_network():
    assert loopback_bytes() == 0
    with socket.create_server(("127.0.0.1", 0)) as server, socket.create_connection(server.getsockname()) as client:
        server.accept()[0].sendall(bytes(1000))
        assert len(client.recv(1000, socket.MSG_WAITALL)) == 1000
    assert 1000 < loopback_bytes() < 3000
    print("own")
else:
    print("refused")
"""


@pytest.mark.skipif(sys.platform != "linux", reason="namespaces are Linux's")
def test_its_loopback_is_up_and_counts_only_us() -> None:
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() in {"own", "refused"}

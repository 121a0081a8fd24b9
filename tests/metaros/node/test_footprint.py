"""What a node costs its process: threads, and memory over many messages."""

from __future__ import annotations

import subprocess
import sys

import pytest

from load_tests.benchmarks.library.memory import run
from tests.support.ports import free_port

linux = pytest.mark.skipif(sys.platform != "linux", reason="threads are counted in /proc")

_TWENTY = """
import os, sys, threading
import metaros
from metaros.interfaces.std_msgs.msg import String

endpoint, other = sys.argv[1], sys.argv[2] == "other"
where = {"connect": endpoint, "listen": []} if other else {"connect": [], "listen": endpoint}
with metaros.Context(domain_id=0, **where) as context, metaros.Node("n" + sys.argv[2], context=context) as node:
    if other:
        publishers = [node.create_publisher(String, f"/t{number}") for number in range(20)]
        print("ready", flush=True)
        sys.stdin.readline()
    heard = set()
    for number in range(0 if other else 20):
        qos = metaros.qos_reliable_all if number % 2 else metaros.qos_default
        node.create_subscription(String, f"/t{number}", lambda m: heard.add(m.data), qos)
    print("ready", flush=True)
    executor = metaros.SingleThreadedExecutor()
    executor.add_node(node)
    while not other and len(heard) < 20:
        executor.spin_once(0.1)
    while other:
        for number, publisher in enumerate(publishers):
            publisher.publish(String(data=str(number)))
        threading.Event().wait(0.05)
    print(sorted(open(f"/proc/self/task/{task}/comm").read().strip() for task in os.listdir("/proc/self/task")))
    print(len(os.listdir("/proc/self/task")), flush=True)
"""


@linux
def test_a_node_with_twenty_subscriptions_of_both_histories_has_at_most_six_threads():
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    command = [sys.executable, "-c", _TWENTY, endpoint]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen([*command, "node"], **pipes) as node, subprocess.Popen([*command, "other"], **pipes) as other:
        try:
            assert node.stdout.readline() == "ready\n"
            assert other.stdout.readline() == "ready\n"
            other.stdin.write("\n")
            other.stdin.flush()
            names, count = node.stdout.readline(), int(node.stdout.readline())
            assert count <= 6, names
        finally:
            node.kill()
            other.kill()


@pytest.mark.integration
def test_many_messages_leave_nothing_behind():
    """A smaller `python -m load_tests memory`: 200 s of 1 kHz."""
    for sizes in run("typed", 200_000).values():
        assert len(sizes) >= 19
        assert sizes[-1] - sizes[len(sizes) // 4] < 32 << 20  # a leak of 220 bytes a message would be more

"""The pool of shared memory by itself: who gets one, what finds no room, what it says when it cannot be had."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections import namedtuple

import pytest

from metaros.errors import ConfigError
from metaros.wire import shm
from metaros.wire.shm import SharedPool, shared_pool

linux = pytest.mark.skipif(sys.platform != "linux", reason="shared memory is used on Linux only")
MIB = 1 << 20


def test_it_is_off_unless_the_program_or_else_the_environment_asks():
    assert shared_pool(None, {}) is None
    assert shared_pool("off", {"METAROS_SHARED_MEMORY": "auto"}) is None
    with pytest.raises(ConfigError, match="METAROS_SHARED_MEMORY: 'on' is none of off, auto"):
        shared_pool(None, {"METAROS_SHARED_MEMORY": "on"})
    with pytest.raises(ConfigError, match="shared_memory: 'yes'"):
        shared_pool("yes", {})


@linux
def test_the_environment_turns_it_on(monkeypatch):
    monkeypatch.setattr(shm, "locks_without_limit", lambda: True)
    assert shared_pool(None, {"METAROS_SHARED_MEMORY": "auto"}) is not None


@linux
def test_who_may_lock_little_does_without_and_is_told(monkeypatch, caplog):
    monkeypatch.setattr(shm, "locks_without_limit", lambda: False)
    assert shared_pool("auto", {}) is None
    assert "may lock little memory: ulimit -l" in caplog.text


@linux
def test_a_limit_counts_for_who_has_no_capability():
    """As an ordinary user: this one, or nobody where the tests run as root."""
    lines = (
        "import mmap, os, resource, sys",
        "from metaros.wire.shm import locks_without_limit",
        "if os.geteuid() == 0: os.setgroups([]); os.setgid(65534); os.setuid(65534)",
        "resource.setrlimit(resource.RLIMIT_MEMLOCK, (65536, resource.getrlimit(resource.RLIMIT_MEMLOCK)[1]))",
        "sys.exit(locks_without_limit())",
    )
    assert subprocess.run([sys.executable, "-c", "\n".join(lines)], env=dict(os.environ)).returncode == 0


@linux
def test_what_finds_no_room_comes_back_as_it_is_and_room_given_back_is_used_again():
    pool = SharedPool(size_bytes=4 * MIB)
    data = bytes(range(256)) * 4096
    kept = []
    while (placed := pool.place(data)) is not data:
        kept.append(placed)
        assert bytes(placed) == data
    assert 1 <= len(kept) <= 4
    assert (pool.placed, pool.refused) == (len(kept), 1)
    kept.clear()
    del placed
    assert pool.place(data) is not data
    assert pool.place(bytes(5 * MIB)) == bytes(5 * MIB)
    assert pool.refused == 2
    pool.close()
    assert pool.place(data) is data


@linux
def test_without_room_in_the_file_system_payloads_take_the_network(monkeypatch, caplog):
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage(0, 0, MIB))
    pool = SharedPool()
    assert [pool.place(b"x" * MIB) == b"x" * MIB for _ in range(3)] == [True] * 3
    assert (pool.placed, pool.refused) == (0, 3)
    assert [record.message.partition(":")[0] for record in caplog.records] == [
        "no shared memory, large payloads take the network"
    ]

"""What the system tells of processes."""

from __future__ import annotations

import os
import sys

import pytest

from load_tests.peers import measure

MAPS = """\
55d0-55e0 r--p 00000000 08:01 1 /usr/bin/python3
1000-3000 r-xp 00000000 08:01 2 /lib/libssl.so.3
3000-3800 rw-p 00000000 08:01 2 /lib/libssl.so.3
4000-5000 r-xp 00000000 08:01 3 /x/_ext.cpython-311-x86_64-linux-gnu.so (deleted)
6000-7000 rw-p 00000000 00:00 0
7000-8000 rw-p 00000000 00:00 0 [heap]
8000-9000 r--p 00000000 08:01 4 /x/something.sold
"""


def test_shared_objects_are_those_that_end_so() -> None:
    assert measure.mapped_shared_objects(MAPS.splitlines()) == 0x2000 + 0x800 + 0x1000


@pytest.mark.skipif(sys.platform != "linux", reason="needs /proc")
def test_of_this_very_process() -> None:
    pid = os.getpid()
    assert measure.thread_count(pid) >= 1  # type: ignore[operator]
    assert measure.resident_bytes(pid) > 1 << 20  # type: ignore[operator]
    assert measure.shared_object_bytes(pid) > 0  # type: ignore[operator]
    assert measure.process_cpu_s(pid) > 0
    assert measure.busy_cpu_s() > 0  # type: ignore[operator]
    assert measure.loopback_bytes() >= 0  # type: ignore[operator]


def test_of_a_process_that_is_not_there() -> None:
    nobody = 1 << 30
    assert measure.thread_count(nobody) is None
    assert measure.resident_bytes(nobody) is None
    assert measure.shared_object_bytes(nobody) is None
    assert measure.process_cpu_s(nobody) == 0.0

"""glibc keeps large blocks, and a user who tunes it is left alone."""

from __future__ import annotations

import platform
import sys

import pytest

from metaros.wire.allocator import keep_large_blocks


@pytest.mark.parametrize("name", ["MALLOC_TRIM_THRESHOLD_", "GLIBC_TUNABLES"])
def test_a_user_s_own_settings_stay(name):
    assert not keep_large_blocks({name: "1"})
    assert not keep_large_blocks({"METAROS_ALLOCATOR": "off"})


@pytest.mark.skipif(
    sys.platform != "linux" or platform.libc_ver()[0] != "glibc", reason="other allocators have no such setting"
)
def test_glibc_takes_it():
    assert keep_large_blocks({})

"""Hashes of types as rclpy shows them."""

from __future__ import annotations

import pytest

from metaros.ros2.rclpy.names.type_hash import TypeHash

TEXT = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"


def test_a_hash_is_read_and_shown() -> None:
    found = TypeHash.from_text(TEXT)
    assert (str(found), found.version, found.value[:2]) == (TEXT, 1, b"\xdf\x66")
    assert found == TypeHash(version=1, value=found.value)
    assert found != TypeHash()
    assert eval(repr(found)) == found


def test_what_is_no_hash_is_invalid() -> None:
    assert [str(TypeHash.from_text(text)) for text in ("", "TypeHashNotSupported", TEXT[:-1])] == ["INVALID"] * 3
    for wrong in ({"version": "1"}, {"version": 1, "value": "x"}):
        with pytest.raises((AssertionError, TypeError)):
            TypeHash(**wrong)

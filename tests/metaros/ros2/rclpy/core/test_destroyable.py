"""Handles: `with` keeps them, and they are destroyed once."""

from __future__ import annotations

import pytest

from metaros.ros2.rclpy.core.destroyable import Destroyable
from metaros.ros2.rclpy.core.handle import InvalidHandle


class _Native:
    def __init__(self) -> None:
        self.closed = 0

    def close(self) -> None:
        self.closed += 1


class _Handle(Destroyable, _Native):
    pass


def test_with_does_not_close() -> None:
    handle = _Handle()
    with handle as same:
        assert same is handle
    assert handle.closed == 0
    assert handle.pointer != _Handle().pointer


def test_it_is_destroyed_when_the_last_user_lets_go() -> None:
    handle = _Handle()
    with handle:
        with handle:
            handle.destroy_when_not_in_use()
            with handle:
                assert handle.closed == 0
        assert handle.closed == 0
    assert handle.closed == 1
    with pytest.raises(InvalidHandle, match="_Handle"), handle:
        pass
    handle.destroy_when_not_in_use()
    assert handle.closed == 1


def test_it_is_destroyed_at_once_where_nobody_uses_it() -> None:
    handle = _Handle()
    handle.destroy_when_not_in_use()
    assert handle.closed == 1

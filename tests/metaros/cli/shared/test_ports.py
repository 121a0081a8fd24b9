"""Choosing ports beside real listeners."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator

import pytest

from metaros.cli.shared.ports import choose_port, port_accepts, port_free, port_owner
from metaros.errors import ConfigError


@pytest.fixture
def busy_port() -> Iterator[int]:
    """A port on which this process listens."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        listener.listen(1)
        yield listener.getsockname()[1]


def test_a_free_default_is_taken(free_port: int) -> None:
    choice = choose_port("dashboard", None, free_port)
    assert (choice.port, choice.moved) == (free_port, False)


def test_a_busy_default_moves_up_and_names_the_owner(busy_port: int) -> None:
    choice = choose_port("dashboard", None, busy_port)
    assert choice.moved
    assert choice.port > busy_port
    assert port_free(choice.port)
    assert f"(pid {os.getpid()})" in choice.owner


def test_a_busy_explicit_port_is_an_error_that_names_the_owner(busy_port: int) -> None:
    with pytest.raises(ConfigError, match=rf"port {busy_port} \(dashboard\) is in use by .*pid {os.getpid()}"):
        choose_port("dashboard", busy_port, 8080)


def test_a_claimed_port_counts_as_busy(free_port: int) -> None:
    choice = choose_port("dashboard", None, free_port, taken=[free_port])
    assert choice.port > free_port
    with pytest.raises(ConfigError, match="another `metaros up`"):
        choose_port("dashboard", free_port, 8080, taken=[free_port])


def test_who_moves_leaves_others_ports_alone(busy_port: int) -> None:
    choice = choose_port("dashboard", None, busy_port, avoid=[busy_port + 1, busy_port + 2])
    assert choice.port > busy_port + 2


def test_a_listener_on_all_addresses_is_in_the_way_of_loopback() -> None:
    with socket.socket() as listener:
        listener.bind(("0.0.0.0", 0))
        listener.listen(1)
        assert not port_free(listener.getsockname()[1])


def test_a_bound_port_that_does_not_listen_is_not_free() -> None:
    with socket.socket() as holder:
        holder.bind(("127.0.0.1", 0))
        assert not port_free(holder.getsockname()[1])


def test_an_address_that_is_not_ours_is_a_clear_error(free_port: int) -> None:
    with pytest.raises(ConfigError, match=r"cannot listen on 203\.0\.113\.7"):
        port_free(free_port, host="203.0.113.7")


def test_who_accepts(busy_port: int, free_port: int) -> None:
    assert port_accepts(busy_port)
    assert not port_accepts(free_port)
    assert port_owner(free_port) == "another program"

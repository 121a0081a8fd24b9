"""Ranges of addresses, and what is refused as one."""

from __future__ import annotations

import pytest

from gateway.domain.networks import is_loopback_address, is_within, parse_networks, read_address
from metaros.errors import ConfigError


def test_addresses_and_ranges() -> None:
    networks = parse_networks(["10.0.0.0/8", " 192.168.1.7 ", "fd00::/8", "172.16.3.9/12"])
    inside = ("10.255.0.1", "192.168.1.7", "fd12::1", "172.31.0.1", "::ffff:10.0.0.1")
    outside = ("11.0.0.1", "192.168.1.8", "fe80::1", "::a00:1")
    assert [is_within(found, networks) for text in inside if (found := read_address(text))] == [True] * len(inside)
    assert [is_within(found, networks) for text in outside if (found := read_address(text))] == [False] * len(outside)


@pytest.mark.parametrize("text", ["", "proxy", "10.0.0.0/33", "10.0.0", "0.0.0.0/0", "::/0"])
def test_what_is_no_range_or_everybody_is_refused_by_name(text: str) -> None:
    with pytest.raises(ConfigError, match="--trusted-proxy"):
        parse_networks([text])


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("10.0.0.1", "10.0.0.1"),
        ("10.0.0.1:5000", "10.0.0.1"),
        ("[2001:db8::1]:5000", "2001:db8::1"),
        ("fe80::1%eth0", "fe80::1"),
        ("::ffff:10.0.0.1", "10.0.0.1"),
        ("unknown", "None"),
        ("", "None"),
    ],
)
def test_an_address_is_read_as_proxies_write_it(text: str, address: str) -> None:
    assert str(read_address(text)) == address


def test_loopback_in_every_spelling() -> None:
    assert all(map(is_loopback_address, ("127.0.0.1", "127.9.9.9", "::1", "::ffff:127.0.0.1")))
    assert not any(map(is_loopback_address, ("10.0.0.1", "::ffff:10.0.0.1", "localhost", "")))

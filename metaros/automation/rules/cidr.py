"""Blocks of IP addresses, as `cidr` in a pattern says them."""

from __future__ import annotations

import ipaddress
from typing import Any

from metaros.automation.rules.errors import PatternError

__all__ = ["Block", "address", "read_block"]

Block = ipaddress.IPv4Network | ipaddress.IPv6Network
LONGEST = 64  # letters of an address, its zone included


def read_block(text: str, path: str) -> Block:
    """The block of an address and a number of bits; bits of the address behind them do not count."""
    try:
        if "/" not in text or not text.rpartition("/")[2].isdigit():
            raise ValueError
        return ipaddress.ip_network(text, strict=False)
    except ValueError:
        raise PatternError(path, f"{text[:60]!r} is no block like 10.0.0.0/24 or 2001:db8::/32") from None


def address(value: Any) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    """The address that a value of an event is, or None."""
    if type(value) is not str or len(value) > LONGEST:
        return None
    try:
        return ipaddress.ip_address(value)
    except ValueError:
        return None

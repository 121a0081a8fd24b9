"""Addresses of the network: which ranges are trusted, which never leave this machine. Pure."""

from __future__ import annotations

import functools
import ipaddress
from collections.abc import Iterable

from metaros.errors import ConfigError

__all__ = ["Address", "Network", "is_loopback_address", "is_within", "parse_networks", "read_address"]

Network = ipaddress.IPv4Network | ipaddress.IPv6Network
Address = ipaddress.IPv4Address | ipaddress.IPv6Address


def parse_networks(texts: Iterable[str]) -> tuple[Network, ...]:
    """Addresses and CIDR ranges, such as 10.0.0.7 and 10.0.0.0/8.

    Raises:
        ConfigError: one of them is neither, or means everybody.
    """
    found: list[Network] = []
    for text in texts:
        try:
            network = ipaddress.ip_network(text.strip(), strict=False)
        except ValueError:
            raise ConfigError(f"--trusted-proxy {text}: not an address or a range like 10.0.0.0/8") from None
        if network.prefixlen == 0:
            raise ConfigError(f"--trusted-proxy {text}: that is everybody; name the proxies' own addresses")
        found.append(network)
    return tuple(found)


@functools.lru_cache(maxsize=1024)  # every request asks, of few addresses
def read_address(text: str) -> Address | None:
    """An address, also with a port behind it; IPv4 written as IPv6 is IPv4. None for what is none."""
    bare = text
    if text.startswith("["):
        bare = text[1:].partition("]")[0]
    elif text.count(":") == 1:
        bare = text.partition(":")[0]
    try:
        found = ipaddress.ip_address(bare.partition("%")[0])
    except ValueError:
        return None
    return (found.ipv4_mapped or found) if isinstance(found, ipaddress.IPv6Address) else found


def is_within(address: Address, networks: Iterable[Network]) -> bool:
    """Whether one of the ranges holds the address."""
    return any(address.version == network.version and address in network for network in networks)


def is_loopback_address(text: str) -> bool:
    """Whether an address never leaves this machine."""
    found = read_address(text)
    return found is not None and found.is_loopback

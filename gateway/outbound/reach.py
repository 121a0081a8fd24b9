"""Which addresses may be sent to: public ones, or with `private` also those of private networks and this machine.

The name is looked up once, and the address that was looked at is the one that is used: nobody leads a request, with its
token, elsewhere between the two.
"""

from __future__ import annotations

import asyncio
import ipaddress
import socket

__all__ = ["UnreachableError", "address_of", "may_go"]

UNICAST = ipaddress.ip_network("2000::/3")  # all that is given out for the internet
IPV4_WITHIN = tuple(map(ipaddress.ip_network, ("64:ff9b::/96", "64:ff9b:1::/48", "::/96", "::ffff:0:0:0/96")))


class UnreachableError(OSError):
    """There is no address that may be sent to."""


async def address_of(host: str, port: int, *, private: bool, hint: str = "") -> str:
    """The address to connect to; UnreachableError where the name has none, or one that may not be sent to.

    `hint` says, behind the error, how a private network is allowed.
    """
    loop = asyncio.get_running_loop()
    try:
        found = await loop.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError) as error:
        raise UnreachableError(f"{host} cannot be found: {error}") from error
    addresses = [str(item[4][0]) for item in found]
    for address in addresses:
        if not may_go(address, private=private):
            raise UnreachableError(f"{host} is {address}, where nothing is sent{'' if private else hint}")
    if not addresses:
        raise UnreachableError(f"{host} has no address")
    return addresses[0]


def may_go(text: str, *, private: bool) -> bool:
    """Whether an address may be sent to; to those of the link, which clouds keep for themselves, nothing ever is."""
    address = _inner(ipaddress.ip_address(text.partition("%")[0]))
    if address.is_multicast or address.is_link_local or address.is_unspecified:
        return False
    return private or (address.is_global and (address.version == 4 or address in UNICAST))


def _inner(address: ipaddress.IPv4Address | ipaddress.IPv6Address) -> ipaddress.IPv4Address | ipaddress.IPv6Address:
    """The IPv4 address within an IPv6 one."""
    if isinstance(address, ipaddress.IPv4Address):
        return address
    if int(address) > 1 and any(address in network for network in IPV4_WITHIN):
        return ipaddress.IPv4Address(int(address) & 0xFFFFFFFF)
    return address.ipv4_mapped or address.sixtofour or (address.teredo[1] if address.teredo else None) or address

"""Where a function may connect to: patterns of hosts and ports, and which addresses a name may lead to.

A pattern is `host[:port]`; without a port it is 443 and 80. The host is a name, `*.` and the end of names, `*` for all,
or an address. Names lead to public addresses only, with `private:` before the pattern to those of private networks and
of this machine too. Addresses of the link, and those that clouds keep for themselves, must be written out.
"""

from __future__ import annotations

import ipaddress
import re
from collections.abc import Callable
from dataclasses import dataclass

from metaros.errors import FieldError

__all__ = ["EGRESS", "EgressPattern", "EgressRules", "address_of", "may_reach", "parse_bound", "parse_egress"]

EGRESS = "METAROS_EGRESS"  # the variable in a function's environment
PORTS = frozenset({443, 80})
MOST_PATTERNS = 100
PRIVATE = "private:"
PUBLIC = "public"
UNICAST = ipaddress.ip_network("2000::/3")  # all that is given out for the internet
IPV4_WITHIN = tuple(map(ipaddress.ip_network, ("64:ff9b::/96", "64:ff9b:1::/48", "::/96", "::ffff:0:0:0/96")))
# Where clouds tell a machine its keys, beside the link's own addresses.
OF_CLOUDS = frozenset(map(ipaddress.ip_address, ("fd00:ec2::254", "100.100.100.200", "168.63.129.16", "192.0.0.192")))
_NAME = re.compile(r"(\*|(\*\.)?[a-z0-9_]([a-z0-9_-]{0,61}[a-z0-9_])?(\.[a-z0-9_]([a-z0-9_-]{0,61}[a-z0-9_])?)*)")

Address = ipaddress.IPv4Address | ipaddress.IPv6Address


@dataclass(frozen=True, slots=True)
class EgressPattern:
    """`host` is in lower case: a name, `*.name`, `*`, or an address as `ipaddress` writes it."""

    host: str
    ports: frozenset[int] = PORTS
    private: bool = False

    @property
    def literal(self) -> bool:
        """Whether it names an address."""
        return address_of(self.host) is not None

    def fits(self, host: str, port: int) -> bool:
        """Whether this host, in lower case, and this port are meant."""
        if port not in self.ports:
            return False
        if self.host.startswith("*."):
            return host.endswith(self.host[1:]) and address_of(host) is None
        return self.host in ("*", host)


EVERYWHERE = EgressPattern("*", frozenset(range(1, 65_536)))


@dataclass(frozen=True, slots=True)
class EgressRules:
    """Some patterns; nothing else may be connected to."""

    patterns: tuple[EgressPattern, ...] = ()

    def check(self, host: str, port: int) -> Callable[[str], bool] | None:
        """Which addresses this host may be connected at; None where it may not at all."""
        fitting = [pattern for pattern in self.patterns if pattern.fits(host, port)]
        if not fitting:
            return None
        literal = any(pattern.literal for pattern in fitting)
        private = any(pattern.private for pattern in fitting)
        return lambda address: literal or may_reach(address, private=private)


def parse_bound(text: str, *, field: str) -> EgressRules | None:
    """What the operator lets functions have: `any` (None: whatever they ask for), `none`, or patterns, of which
    `public` is every public address at every port. FieldError.
    """
    if text in ("any", "none"):
        return None if text == "any" else EgressRules()
    words = [word.strip() for word in text.split(",")]
    named = parse_egress(",".join(word for word in words if word != PUBLIC), field=field).patterns
    return EgressRules((*named, EVERYWHERE)) if PUBLIC in words else EgressRules(named)


def parse_egress(text: str, *, field: str = EGRESS) -> EgressRules:
    """The rules that a list of patterns, with commas between them, means; FieldError names the pattern that is none."""
    words = [word.strip() for word in text.split(",")]
    patterns = tuple(_pattern(word, field) for word in words if word)
    if len(patterns) > MOST_PATTERNS:
        raise FieldError(f"{field}: {len(patterns)} patterns, at most {MOST_PATTERNS}")
    return EgressRules(patterns)


def _pattern(word: str, field: str) -> EgressPattern:
    private = word.startswith(PRIVATE)
    host, port = _split(word.removeprefix(PRIVATE))
    wrong = f"{field}: {word[:200]!r} is no pattern: "
    if port and not (port.isascii() and port.isdigit() and 0 < int(port[:6]) < 65536):
        raise FieldError(f"{wrong}the port is 1 to 65535")
    ports = frozenset({int(port)}) if port else PORTS
    address = address_of(host.strip("[]"))
    if address is not None and (address.version == 4) != host.startswith("["):
        return EgressPattern(str(address), ports)
    host = host.lower().removesuffix(".") if host != "*." else host
    if not _NAME.fullmatch(host) or len(host) > 253 or host.rpartition(".")[2].isdigit():
        raise FieldError(
            f"{wrong}it is [private:]HOST[:PORT]; the host is a name (other letters as xn--…), *.name, * or an address"
            " (IPv6 in [])"
        )
    return EgressPattern(host, ports, private)


def _split(word: str) -> tuple[str, str]:
    """Host, with its brackets, and port; a colon with nothing behind it stays, and is refused."""
    host, colon, port = word.rpartition(":")
    return (host, port) if colon and port and not port.endswith("]") else (word, "")


def address_of(host: str) -> Address | None:
    """The address that is written so, without brackets; None: it is a name."""
    try:
        return ipaddress.ip_address(host)
    except ValueError:
        return None


def may_reach(text: str, *, private: bool) -> bool:
    """Whether an address that a name led to may be connected to."""
    address = ipaddress.ip_address(text.partition("%")[0])
    inner = _inner(address)
    if {address, inner} & OF_CLOUDS or inner.is_multicast or inner.is_link_local or inner.is_unspecified:
        return False
    return private or (inner.is_global and (inner.version == 4 or inner in UNICAST))


def _inner(address: Address) -> Address:
    """The IPv4 address within an IPv6 one."""
    if isinstance(address, ipaddress.IPv4Address):
        return address
    if int(address) > 1 and any(address in network for network in IPV4_WITHIN):
        return ipaddress.IPv4Address(int(address) & 0xFFFFFFFF)
    return address.ipv4_mapped or address.sixtofour or (address.teredo[1] if address.teredo else None) or address

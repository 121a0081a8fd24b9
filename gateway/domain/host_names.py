"""The names and addresses by which other machines reach this one: for host checks, certificates and output."""

from __future__ import annotations

import contextlib
import importlib
import ipaddress
import re
import socket

__all__ = ["host_part", "is_wildcard", "machine_names", "outward_address", "url_of"]

# Addresses of nobody (RFC 5737, RFC 3849): a UDP socket "connected" to one sends nothing, but tells the way out.
_ELSEWHERE = ((socket.AF_INET, "192.0.2.1"), (socket.AF_INET6, "2001:db8::1"))
_NAME = re.compile(r"[a-z0-9](?:[a-z0-9._-]{0,251}[a-z0-9])?|[0-9a-f:.]{2,45}")  # what a certificate may say


def is_wildcard(host: str) -> bool:
    """Whether listening there means every address of this machine."""
    try:
        return ipaddress.ip_address(host).is_unspecified
    except ValueError:
        return False


def outward_address() -> str:
    """The address with which this machine reaches others; "" where it has no way out."""
    for family, address in _ELSEWHERE:
        with contextlib.suppress(OSError), socket.socket(family, socket.SOCK_DGRAM) as probe:
            probe.connect((address, 9))
            found = str(probe.getsockname()[0])
            if not ipaddress.ip_address(found).is_loopback:
                return found
    return ""


def machine_names() -> tuple[str, ...]:
    """The host name and the addresses of the interfaces, as far as the system tells; loopback apart."""
    names = [socket.gethostname().lower(), outward_address(), *_interface_addresses()]
    return tuple(dict.fromkeys(name for name in names if _NAME.fullmatch(name) and not _is_loopback(name)))


def host_part(host: str) -> str:
    """A host as it is written in a URL."""
    return f"[{host}]" if ":" in host and not host.startswith("[") else host


def url_of(scheme: str, host: str, port: int) -> str:
    """The URL of a server on this host and port."""
    return f"{scheme}://{host_part(host)}:{port}"


def _interface_addresses() -> list[str]:
    try:
        psutil = importlib.import_module("psutil")
    except ImportError:
        return []
    found: list[str] = []
    with contextlib.suppress(OSError, psutil.Error):
        for addresses in psutil.net_if_addrs().values():
            kinds = (socket.AF_INET, socket.AF_INET6)
            found += [item.address for item in addresses if item.family in kinds and "%" not in item.address]
    return found


def _is_loopback(name: str) -> bool:
    try:
        return ipaddress.ip_address(name).is_loopback
    except ValueError:
        return name == "localhost" or name.endswith(".localhost")

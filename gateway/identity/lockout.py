"""Account lockout: the wait after failed sign-ins, by name and address. Pure.

Every attempt counts as a failure before its password is looked at, and success forgets them all. So a hundred
attempts at the same moment are no better than one after the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from gateway.errors import TooManyRequestsError
from gateway.store.accounts.sessions import Failures

__all__ = ["LOCKOUT", "LockOut", "address_group"]

SECOND_NS = 10**9
_LONGEST = 64  # of an address: longer text is none


@dataclass(frozen=True, slots=True, kw_only=True)
class LockOut:
    """`free` attempts cost nothing; then each one doubles the wait, from `first_s` to `most_s`."""

    free: int = 5
    first_s: float = 1.0
    most_s: float = 900.0
    forget_s: float = 3600.0  # without an attempt for so long all is forgotten

    def delay_s(self, failures: int) -> float:
        """The wait after so many failures."""
        over = failures - self.free
        return 0.0 if over < 0 else min(self.most_s, self.first_s * 2.0 ** min(over, 64))

    def attempt(self, state: Failures | None, *, now_ns: int) -> Failures:
        """The state once this attempt counts as failed.

        Raises:
            TooManyRequestsError: it comes too early; it does not count, so that waiting always ends.
        """
        if state is None or now_ns - state.last_ns >= self.forget_s * SECOND_NS:
            state = Failures(0, now_ns, 0)
        # A wait is never longer than the longest, even when the clock was set back meanwhile.
        wait_ns = min(state.until_ns - now_ns, round(self.most_s * SECOND_NS))
        if wait_ns > 0:
            raise TooManyRequestsError("too many failed sign-ins: wait", retry_after_s=wait_ns / SECOND_NS)
        failures = min(state.failures + 1, 1_000_000)
        return Failures(failures, now_ns, now_ns + round(self.delay_s(failures) * SECOND_NS))


LOCKOUT = LockOut()


def address_group(address: str) -> str:
    """What counts as one address: an IPv4 address, or the /64 network of an IPv6 one, whose hosts are free to choose.

    Text that is no address stands for itself.
    """
    return _remembered(address) if len(address) <= _LONGEST else _shortened(address)


def _group(address: str) -> str:
    import ipaddress

    try:
        found = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return _shortened(address)
    if isinstance(found, ipaddress.IPv4Address):
        return str(found)
    if found.ipv4_mapped is not None:
        return str(found.ipv4_mapped)
    return str(ipaddress.ip_network((found, 64), strict=False))


def _shortened(text: str) -> str:
    return text.encode("ascii", "replace").decode()[:_LONGEST]


_remembered = lru_cache(maxsize=4096)(_group)  # every request asks, of few addresses

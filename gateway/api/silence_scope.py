"""Authorization of silences by scope: a silence covers no robot that its maker does not see.

REST and gRPC ask here. A silence that names robots is made by whoever sees all of them; one of the whole fleet keeps
everybody's alerts quiet, those of robots that come later too, and needs `alerts.manage` with a scope of all robots.
"""

from __future__ import annotations

from collections.abc import Sequence

from gateway.domain.alert import Silence
from gateway.domain.principal import Principal
from gateway.errors import ForbiddenError
from gateway.identity.permissions import permission

__all__ = ["check_silence_scope", "covers", "sees_silence"]

FLEET = "alerts.manage"


def check_silence_scope(principal: Principal, robots: Sequence[str]) -> None:
    """ForbiddenError where `principal` may not silence all of these robots (ids and patterns; none is the fleet)."""
    if _is_fleet(robots):
        if not (principal.sees_all and permission(FLEET).granted(principal)):
            raise ForbiddenError(f"a silence of the whole fleet needs {FLEET} and a scope of all robots")
    elif not covers(principal, robots):
        raise ForbiddenError("robots: a silence reaches no robot out of the scope of who makes or ends it")


def covers(principal: Principal, robots: Sequence[str]) -> bool:
    """Whether the principal sees, for certain, whatever these ids and patterns (`*`, `?`) match; none match all."""
    return principal.sees_all or (bool(robots) and all(_covered(principal, item) for item in robots))


def sees_silence(principal: Principal, silence: Silence) -> bool:
    """Whether the principal may know of it."""
    return covers(principal, silence.robots)


def _is_fleet(robots: Sequence[str]) -> bool:
    return not robots or any(not item.strip("*") for item in robots)


def _covered(principal: Principal, item: str) -> bool:
    if "?" in item:
        return False
    return item in principal.robots or ("*" not in item and principal.sees(item))

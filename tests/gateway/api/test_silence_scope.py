"""A silence reaches no further than who makes it: what counts as within a scope, and what needs more than a role."""

from __future__ import annotations

import pytest

from gateway.api.silence_scope import check_silence_scope, covers, sees_silence
from gateway.domain.alert import Silence
from gateway.domain.principal import Principal, Role
from gateway.errors import ForbiddenError
from tests.support.tables import refusal


def somebody(role: Role, *robots: str) -> Principal:
    """A user with that scope."""
    return Principal(kind="user", id="u", name="ada", role=role, robots=robots)


REACHES: tuple[tuple[tuple[str, ...], tuple[str, ...], bool], ...] = (  # a scope, robots asked for, all within it
    (("lab_*",), ("lab_1",), True),
    (("lab_*",), ("lab_*",), True),
    (("lab_*", "hall_1"), ("lab_7", "hall_1"), True),
    (("lab_*",), ("hall_1",), False),
    (("lab_*",), ("lab_1", "hall_1"), False),
    (("lab_*",), ("*",), False),
    (("lab_*",), ("lab_1*",), False),  # perhaps; but not for certain
    (("lab_1",), ("lab_?",), False),
    (("lab_?",), ("lab_?",), False),
    (("lab_*",), (), False),
    (("*",), (), True),
    (("*",), ("h?ll_*",), True),
    ((), ("lab_1",), False),
)


def test_what_is_within_a_scope_for_certain() -> None:
    wrong = []
    for scope, asked, within in REACHES:
        silence = Silence(id="s", robots=asked, from_ns=0, until_ns=1, by="ada")
        reached = covers(somebody(Role.OPERATOR, *scope), asked)
        seen = sees_silence(somebody(Role.VIEWER, *scope), silence)
        if (reached, seen) != (within, within):
            wrong.append((scope, asked, reached, seen))
    assert wrong == []


def test_the_whole_fleet_is_silenced_by_an_admin_of_all_robots_alone() -> None:
    fleets: tuple[tuple[str, ...], ...] = ((), ("*",), ("**",), ("lab_1", "***"))
    for fleet in fleets:
        check_silence_scope(somebody(Role.ADMIN, "*"), fleet)
        for who in (somebody(Role.OPERATOR, "*"), somebody(Role.ADMIN, "lab_*"), somebody(Role.OPERATOR, *fleet)):
            assert "alerts.manage" in refusal(ForbiddenError, check_silence_scope, who, fleet), (who, fleet)


def test_robots_are_silenced_by_who_sees_them() -> None:
    check_silence_scope(somebody(Role.OPERATOR, "lab_*"), ("lab_1", "lab_*"))
    check_silence_scope(somebody(Role.OPERATOR, "*"), ("lab_?", "hall_*"))
    with pytest.raises(ForbiddenError, match="scope"):
        check_silence_scope(somebody(Role.OPERATOR, "lab_*"), ("lab_1", "hall_1"))

"""A silence reaches no further than who makes it: what counts as within a scope, and what needs more than a role."""

from __future__ import annotations

import pytest

from gateway.api.silence_reach import check_reach, reaches, sees_silence
from gateway.domain.alert import Silence
from gateway.domain.principal import Principal, Role
from gateway.errors import ForbiddenError


def somebody(role: Role, *robots: str) -> Principal:
    """A user with that scope."""
    return Principal(kind="user", id="u", name="ada", role=role, robots=robots)


@pytest.mark.parametrize(
    ("scope", "asked", "within"),
    [
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
    ],
)
def test_what_is_within_a_scope_for_certain(scope: tuple[str, ...], asked: tuple[str, ...], within: bool) -> None:
    assert reaches(somebody(Role.OPERATOR, *scope), asked) is within
    silence = Silence(id="s", robots=asked, from_ns=0, until_ns=1, by="ada")
    assert sees_silence(somebody(Role.VIEWER, *scope), silence) is within


@pytest.mark.parametrize("fleet", [(), ("*",), ("**",), ("lab_1", "***")])
def test_the_whole_fleet_is_silenced_by_an_admin_of_all_robots_alone(fleet: tuple[str, ...]) -> None:
    check_reach(somebody(Role.ADMIN, "*"), fleet)
    for who in (somebody(Role.OPERATOR, "*"), somebody(Role.ADMIN, "lab_*"), somebody(Role.OPERATOR, *fleet)):
        with pytest.raises(ForbiddenError, match=r"alerts\.manage"):
            check_reach(who, fleet)


def test_robots_are_silenced_by_who_sees_them() -> None:
    check_reach(somebody(Role.OPERATOR, "lab_*"), ("lab_1", "lab_*"))
    check_reach(somebody(Role.OPERATOR, "*"), ("lab_?", "hall_*"))
    with pytest.raises(ForbiddenError, match="scope"):
        check_reach(somebody(Role.OPERATOR, "lab_*"), ("lab_1", "hall_1"))

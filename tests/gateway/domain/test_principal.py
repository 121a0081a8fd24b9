"""Principals: what they see, and roles in order."""

from __future__ import annotations

import pytest

from gateway.domain.principal import EVERY_ROBOT, NOBODY, Principal, Role, anonymous_viewer, check_robots


def test_roles_are_in_order_and_have_words() -> None:
    assert Role.NONE < Role.VIEWER < Role.OPERATOR < Role.ADMIN
    assert [Role.of(role.word) for role in Role if role] == [Role.VIEWER, Role.OPERATOR, Role.ADMIN]
    for word in ("none", "root", "", "ADMIN", "viewer "):
        with pytest.raises(ValueError, match="is no role"):
            Role.of(word)


@pytest.mark.parametrize(
    ("robots", "seen", "unseen"),
    [
        (EVERY_ROBOT, ["a", "sim_1", "x.y-z"], []),
        (("sim_1",), ["sim_1"], ["sim_10", "sim_", "Sim_1", "xsim_1"]),
        (("sim_*",), ["sim_1", "sim_", "sim_a.b"], ["si", "asim_1"]),
        (("a", "b-*.x"), ["a", "b-1.x"], ["b", "b-1.y", "aa"]),
        ((), [], ["a", "*", ""]),
    ],
)
def test_what_is_in_scope(robots: tuple[str, ...], seen: list[str], unseen: list[str]) -> None:
    principal = Principal(kind="key", role=Role.ADMIN, robots=robots)
    assert [robot for robot in [*seen, *unseen] if principal.sees(robot)] == seen
    assert principal.sees_all is (robots == EVERY_ROBOT)


def test_nobody_sees_nothing_and_the_local_viewer_all() -> None:
    assert (NOBODY.role, NOBODY.sees("a")) == (Role.NONE, False)
    assert (anonymous_viewer().role, anonymous_viewer().sees("a")) == (Role.VIEWER, True)


def test_patterns_are_checked() -> None:
    assert check_robots(["a", "b_*", "a"]) == ("a", "b_*")
    for bad in ("", "a b", "é", "a" * 300, "a\n"):
        with pytest.raises(ValueError):
            check_robots([bad])

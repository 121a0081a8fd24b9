"""The table of permissions: its rows are sound by themselves."""

from __future__ import annotations

import re

from gateway.domain.principal import EVERY_ROBOT, Principal, Role, anonymous_viewer
from gateway.identity.permissions import PERMISSIONS, permission


def test_names_are_unique_and_of_one_form() -> None:
    names = [row.name for row in PERMISSIONS]
    assert len(set(names)) == len(names)
    assert [name for name in names if not re.fullmatch(r"[a-z]+(_[a-z]+)?\.[a-z]+", name)] == []
    assert [permission(name).name for name in names] == names


def test_what_people_may_asks_for_a_role_and_the_rest_for_none() -> None:
    for row in PERMISSIONS:
        assert (row.least is Role.NONE) == (row.who != "people"), row.name
        assert row.meaning, row.name


def test_more_role_is_never_less_right() -> None:
    for row in PERMISSIONS:
        if row.who not in ("robots", "enrolled"):
            granted = [row.granted(Principal(kind="key", role=role, robots=EVERY_ROBOT)) for role in Role]
            assert granted == sorted(granted), row.name
            assert granted[-1], row.name


def test_nobody_anonymous_changes_anything() -> None:
    almighty = Principal(kind="anonymous", role=Role.ADMIN, robots=EVERY_ROBOT)
    for row in PERMISSIONS:
        if row.mutates and row.who == "people":
            assert not row.granted(almighty), row.name
    assert permission("robots.read").granted(anonymous_viewer())


def test_a_robot_may_link_and_what_everybody_may() -> None:
    robot = Principal(kind="robot", id="sim_1", role=Role.ADMIN, robots=("sim_1",))
    granted = {row.name for row in PERMISSIONS if row.granted(robot)}
    assert granted == {row.name for row in PERMISSIONS if row.who != "people"}
    for name in ("agent.link", "updates.fetch"):
        assert not permission(name).granted(Principal(kind="user", role=Role.ADMIN))
    assert not permission("updates.fetch").granted(anonymous_viewer())

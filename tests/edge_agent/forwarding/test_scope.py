"""Which names are this agent's."""

from __future__ import annotations

import pytest

from edge_agent.forwarding.scope import Scope


@pytest.mark.parametrize(
    ("name", "included"),
    [("/sim_1/odom", True), ("/sim_10/odom", False), ("/odom", False), ("/sim_1", False), ("/sim_1/a/b", True)],
)
def test_namespace(name: str, included: bool) -> None:
    assert Scope("/sim_1").includes(name) is included


def test_root_without_the_other_agents_namespaces() -> None:
    scope = Scope("/", ["/sim_*/**"])
    assert scope.includes("/host/cpu")
    assert not scope.includes("/sim_1/odom")


def test_rosout_is_tapped_by_every_agent() -> None:
    assert Scope("/sim_1").taps("/rosout")
    assert not Scope("/sim_1").includes("/rosout")
    assert not Scope("/sim_1").taps("/tf")


def test_what_tools_hide_at_the_root_is_not_tapped_but_actions_are() -> None:
    assert not Scope("/").taps("/_metaros_canary_1234")
    assert Scope("/").taps("/dock/_action/feedback")

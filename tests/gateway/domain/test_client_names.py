"""Names of a fleet's robots, as its clients see them."""

from __future__ import annotations

from gateway.domain.client_names import ClientNames


def test_one_robot_keeps_its_names() -> None:
    names = ClientNames("r1")
    assert names.shown("r1", "/odom") == "/odom"
    assert names.candidates("/odom") == [("r1", "/odom")]
    assert names.candidates("odom") == [("r1", "/odom")]
    assert names.covers("r1")
    assert not names.covers("r2")


def test_a_fleet_has_the_robots_id_before_each_name() -> None:
    names = ClientNames()
    assert names.shown("r1", "/odom") == "/r1/odom"
    assert names.shown("sim_1", "/sim_1/odom") == "/sim_1/odom"
    assert names.shown("sim_1", "/sim_10/odom") == "/sim_1/sim_10/odom"
    for robot, name in (("r1", "/odom"), ("sim_1", "/sim_1/odom"), ("sim_1", "/sim_10/odom")):
        assert (robot, name) in names.candidates(names.shown(robot, name))
    assert names.candidates("/odom") == []


def test_out_of_scope_is_not_there() -> None:
    names = ClientNames(sees=lambda robot: robot == "r1")
    assert names.candidates("/r2/odom") == []
    assert not names.covers("r2")
    assert ClientNames("r2", sees=lambda robot: robot == "r1").candidates("/odom") == []

"""What every node of ROS 2 is asked: parameters, states, logs, the time."""

from __future__ import annotations

import itertools

import pytest

from tests.ros2.participant import SPEED, Fields, Participant, clocked, managed
from tests.ros2.scenarios import scenario
from tests.support.waiting import wait_until

pytestmark = pytest.mark.xdist_group("ros2")
S = 1_000_000_000
SECONDS = itertools.count(1000)


@scenario("parameters, and refusals", told="have parameters", heard="use parameters")
def test_parameters_are_read_and_set_or_refused(teller: Participant, hearer: Participant) -> None:
    node = teller.name
    assert hearer.parameters(node)["speed"] == SPEED
    assert hearer.set_parameter(node, "speed", 0.25) is None
    assert hearer.parameters(node)["speed"] == 0.25
    assert hearer.set_parameter(node, "speed", 7.5)  # the reason
    assert hearer.set_parameter(node, "speed", "fast")
    assert hearer.parameters(node)["speed"] == 0.25
    assert hearer.set_parameter(node, "speed", SPEED) is None


@scenario("parameter events", told="have parameters", heard="listen to nodes")
def test_changes_of_parameters_are_told_to_all(teller: Participant, hearer: Participant) -> None:
    heard = hearer.listen("/parameter_events", "rcl_interfaces/msg/ParameterEvent")
    values = iter([0.25, SPEED] * 1000)

    def told() -> list[Fields]:
        assert hearer.set_parameter(teller.name, "speed", next(values)) is None
        return [event for event in heard() if event["node"] == f"/{teller.name}"]

    wait_until(told)
    assert hearer.set_parameter(teller.name, "speed", SPEED) is None
    (changed,) = told()[0]["changed_parameters"]
    assert (changed["name"], changed["value"]["type"]) == ("speed", 3)
    assert changed["value"]["double_value"] in (0.25, SPEED)
    assert hearer.set_parameter(teller.name, "speed", SPEED) is None


@scenario("lifecycle nodes", told="have states", heard="change states")
def test_states_are_read_and_changed_and_told(teller: Participant, hearer: Participant) -> None:
    node = managed(teller.name)
    assert hearer.state(node) == "unconfigured"
    assert hearer.change_state(node, "configure")
    assert hearer.state(node) == "inactive"
    assert not hearer.change_state(node, "configure")
    assert hearer.change_state(node, "activate")
    assert hearer.state(node) == "active"
    assert hearer.change_state(node, "deactivate")
    assert hearer.change_state(node, "cleanup")
    assert hearer.state(node) == "unconfigured"


@scenario("transition events", told="have states", heard="listen to nodes")
def test_transitions_are_told_to_all(teller: Participant, hearer: Participant) -> None:
    node = managed(teller.name)
    heard = hearer.listen(f"/{node}/transition_event", "lifecycle_msgs/msg/TransitionEvent")

    def told() -> set[tuple[str, str]]:
        assert hearer.change_state(node, "configure")
        assert hearer.change_state(node, "cleanup")
        return {(event["start_state"]["label"], event["goal_state"]["label"]) for event in heard()}

    ways = {("unconfigured", "configuring"), ("configuring", "inactive"), ("inactive", "cleaningup")}
    wait_until(lambda: told() >= {*ways, ("cleaningup", "unconfigured")})


@scenario("logs on /rosout", told="log", heard="hear logs")
def test_logs_are_heard(teller: Participant, hearer: Participant) -> None:
    heard = hearer.listen("/rosout", "rcl_interfaces/msg/Log", latched=True)

    def told() -> bool:
        assert hearer.add(teller.name, 20, 22) == 42
        return any((entry["name"], entry["msg"]) == (teller.name, "20 + 22") for entry in heard())

    wait_until(told)
    (entry, *_) = [entry for entry in heard() if entry["name"] == teller.name]
    assert entry["level"] == 20
    assert entry["stamp"]["sec"] > 1_600_000_000


@scenario("simulated time by /clock", told="tell time", heard="keep time")
def test_the_clock_is_followed(teller: Participant, hearer: Participant) -> None:
    """Each time is later than those of the tests before."""
    node, sec = clocked(hearer.name), next(SECONDS)
    tick = teller.speak("/clock", "rosgraph_msgs/msg/Clock", {"clock": {"sec": sec, "nanosec": 5}})
    wait_until(lambda: (tick() and False) or hearer.now(node) == sec * S + 5)
    assert hearer.now(hearer.name) > 1_600_000_000 * S

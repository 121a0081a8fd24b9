"""The managed node, exhaustively: every state with every request and every result."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from metaros.errors import UsageError
from metaros.interfaces.lifecycle_msgs import msg
from metaros.node.lifecycle.state_machine import STATES, TRANSITIONS, Result, State, StateMachine

LABELS = ("configure", "cleanup", "activate", "deactivate", "shutdown")
S, F, E = Result.SUCCESS, Result.FAILURE, Result.ERROR

# The public design of managed nodes, written a second time: (primary state, request) -> state while the callback
# runs, and the state after each result; an error goes through errorprocessing.
DESIGN = {
    ("unconfigured", "configure"): ("configuring", {S: "inactive", F: "unconfigured", E: "errorprocessing"}),
    ("inactive", "cleanup"): ("cleaningup", {S: "unconfigured", F: "inactive", E: "errorprocessing"}),
    ("inactive", "activate"): ("activating", {S: "active", F: "inactive", E: "errorprocessing"}),
    ("active", "deactivate"): ("deactivating", {S: "inactive", F: "active", E: "errorprocessing"}),
    ("unconfigured", "shutdown"): ("shuttingdown", {S: "finalized", F: "finalized", E: "errorprocessing"}),
    ("inactive", "shutdown"): ("shuttingdown", {S: "finalized", F: "finalized", E: "errorprocessing"}),
    ("active", "shutdown"): ("shuttingdown", {S: "finalized", F: "finalized", E: "errorprocessing"}),
}
AFTER_ERROR = {S: "unconfigured", F: "finalized", E: "finalized"}
PRIMARY = [state for state in STATES if state.primary and state.id]


def at(state: State) -> StateMachine:
    machine = StateMachine()
    machine.state = state
    return machine


def test_a_node_begins_unconfigured() -> None:
    assert (StateMachine().state.id, StateMachine().state.label) == (1, "unconfigured")


@pytest.mark.parametrize(("state", "label"), list(itertools.product(PRIMARY, LABELS)))
def test_requests_from_primary_states(state: State, label: str) -> None:
    machine = at(state)
    expected = DESIGN.get((state.label, label))
    if expected is None:
        assert machine.find(label) is None
        with pytest.raises(UsageError, match=f"no transition '{label}' from {state.label}"):
            machine.request(label)
        assert machine.state == state
        return
    running, results = expected
    for result, after in results.items():
        machine = at(state)
        transition = machine.request(label)
        assert (transition.start, transition.goal, machine.state.label) == (state, machine.state, running)
        assert at(state).request(transition.id) == transition
        assert machine.finish(result).goal.label == machine.state.label == after


@pytest.mark.parametrize("state", [state for state in STATES if not state.primary])
def test_no_request_while_a_callback_runs(state: State) -> None:
    for wanted in (*LABELS, *range(100)):
        machine = at(state)
        assert machine.find(wanted) is None
        with pytest.raises(UsageError):
            machine.request(wanted)
        assert machine.state == state


@pytest.mark.parametrize(("state", "result"), list(itertools.product(PRIMARY, Result)))
def test_no_result_without_a_request(state: State, result: Result) -> None:
    with pytest.raises(UsageError, match="no transition is under way"):
        at(state).finish(result)


@pytest.mark.parametrize("result", Result)
def test_error_processing(result: Result) -> None:
    machine = StateMachine()
    machine.request("configure")
    machine.finish(Result.ERROR)
    assert machine.finish(result).id == {S: 60, F: 61, E: 62}[result]
    assert machine.state.label == AFTER_ERROR[result]


def test_a_finalized_node_stays() -> None:
    machine = StateMachine()
    machine.request(5)
    machine.finish(Result.SUCCESS)
    assert machine.available() == ()
    with pytest.raises(UsageError, match="nothing is possible"):
        machine.request("configure")


def test_numbers_are_those_of_lifecycle_msgs() -> None:
    numbers = {name: value for name, value in vars(msg.State).items() if isinstance(value, int)}
    assert len(numbers) == len(STATES)
    for state in STATES:
        name = {0: "PRIMARY_STATE_UNKNOWN"}.get(state.id, "")
        kind = "PRIMARY" if state.primary else "TRANSITION"
        assert numbers[name or f"{kind}_STATE_{state.label.upper()}"] == state.id
    constants = {name: value for name, value in vars(msg.Transition).items() if name.startswith("TRANSITION_")}
    unused = {"CREATE": 0, "DESTROY": 8, "CALLBACK_SUCCESS": 97, "CALLBACK_FAILURE": 98, "CALLBACK_ERROR": 99}
    used = set(constants.values()) - set(unused.values())
    assert {transition.id for transition in TRANSITIONS} == used
    assert len(TRANSITIONS) == len(used)


def test_what_is_offered_where() -> None:
    offered = {state.label: [(t.id, t.label) for t in at(state).available()] for state in PRIMARY}
    assert offered == {
        "unconfigured": [(1, "configure"), (5, "shutdown")],
        "inactive": [(2, "cleanup"), (3, "activate"), (6, "shutdown")],
        "active": [(4, "deactivate"), (7, "shutdown")],
        "finalized": [],
    }
    assert [t.id for t in at(STATES[-1]).available()] == [60, 61, 62]


@given(st.lists(st.one_of(st.sampled_from(LABELS), st.sampled_from(list(Result)), st.integers(-5, 105))))
def test_whatever_happens_the_state_follows_the_table(events: list[str | Result | int]) -> None:
    machine = StateMachine()
    for event in events:
        before = machine.state
        try:
            taken = machine.finish(event) if isinstance(event, Result) else machine.request(event)
        except UsageError:
            assert machine.state == before
            continue
        assert taken in TRANSITIONS
        assert (taken.start, taken.goal) == (before, machine.state)
        assert taken.requested is not isinstance(event, Result)

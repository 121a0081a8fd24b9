"""The pure store: types, ranges, choices, atomic sets, callbacks, listing; and that no refused set leaves a trace."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from metaros.errors import ParameterError, UnknownParameterError
from metaros.limits import LIMITS
from metaros.node.parameters import NodeParameters, ParameterDescriptor, ParameterStore, ParameterType, Range
from metaros.node.parameters.values import as_parameter_type, convert, fit, infer, kind_of

# a busy machine is no fault of the code
unhurried = settings(deadline=None, max_examples=50, suppress_health_check=[HealthCheck.too_slow])

SCALARS = {
    ParameterType.BOOL: st.booleans(),
    ParameterType.INTEGER: st.integers(-(1 << 63), (1 << 63) - 1),
    ParameterType.DOUBLE: st.floats(),
    ParameterType.STRING: st.text(),
    ParameterType.BYTE_ARRAY: st.binary(),
}
ARRAYS = {
    ParameterType.BOOL_ARRAY: st.lists(st.booleans(), min_size=1),
    ParameterType.INTEGER_ARRAY: st.lists(st.integers(-(1 << 63), (1 << 63) - 1), min_size=1),
    ParameterType.DOUBLE_ARRAY: st.lists(st.floats(), min_size=1),
    ParameterType.STRING_ARRAY: st.lists(st.text(), min_size=1),
}
VALUES = SCALARS | ARRAYS
typed = st.sampled_from(sorted(VALUES)).flatmap(lambda kind: st.tuples(st.just(kind), VALUES[kind]))


@pytest.fixture
def parameters():
    return NodeParameters("/robot")


@unhurried
@given(typed)
def test_every_value_keeps_its_type_and_no_other_type_takes_it(pair):
    kind, value = pair
    assert kind_of(infer(value)) is kind
    np.testing.assert_equal(fit(value, kind), value)
    others = set(VALUES) - {kind}
    if kind in (ParameterType.INTEGER, ParameterType.INTEGER_ARRAY):
        others -= {ParameterType.DOUBLE, ParameterType.DOUBLE_ARRAY}
    for other in others:
        with pytest.raises(ParameterError, match="wrong type"):
            fit(value, other)


def test_only_what_loses_nothing_is_converted():
    assert fit(3, ParameterType.DOUBLE) == 3.0
    assert type(fit(3, ParameterType.DOUBLE)) is float
    assert fit([1, 2], ParameterType.DOUBLE_ARRAY) == [1.0, 2.0]
    assert fit([], ParameterType.INTEGER_ARRAY) == []
    assert infer([1, 2.5]) == [1.0, 2.5]
    assert infer(np.array([1, 2], dtype=np.int16)) == [1, 2]
    assert infer((True, False)) == [True, False]
    assert infer(np.float32(0.5)) == 0.5
    assert infer(bytearray(b"\1")) == b"\1"
    for wrong in ((1 << 60) + 1, 1 << 63):
        with pytest.raises(ParameterError):
            fit(wrong, ParameterType.DOUBLE)
    for wrong in ({}, [[1]], [1, "a"], [None], object(), [1, True]):
        with pytest.raises(ParameterError, match="no parameter value"):
            infer(wrong)


def test_types_may_be_named_in_three_ways():
    assert as_parameter_type(list[float]) is as_parameter_type("double array") is ParameterType.DOUBLE_ARRAY
    assert as_parameter_type(ParameterType.BOOL) is as_parameter_type(bool)
    for wrong in (dict, "speed", 7, [1]):
        with pytest.raises(ParameterError, match="no parameter type"):
            as_parameter_type(wrong)


def test_what_people_type_becomes_the_parameters_type():
    from metaros.node.parameters.files import parse_value

    assert convert("2", ParameterType.DOUBLE, parse_value) == 2.0
    assert convert("2", ParameterType.STRING, parse_value) == "2"
    assert convert("'2'", ParameterType.STRING, parse_value) == "2"
    assert convert("[1, 255]", ParameterType.BYTE_ARRAY, parse_value) == b"\1\xff"
    assert convert("1e-3", ParameterType.NOT_SET, parse_value) == 0.001
    with pytest.raises(ParameterError, match="expected integer, got double"):
        convert("2.5", ParameterType.INTEGER, parse_value)


def test_a_declared_parameter_is_typed_and_described(parameters):
    assert parameters.declare("speed", 0.5, minimum=0.0, maximum=1.0, description="m/s") == 0.5
    parameters["speed"] = 1
    assert parameters["speed"] == 1.0
    assert parameters.describe("speed").range == Range(0.0, 1.0)
    for wrong, why in ((1.5, "not within 0.0..1.0"), ("fast", "expected double, got string"), (float("nan"), "within")):
        with pytest.raises(ParameterError, match=why):
            parameters["speed"] = wrong
    assert parameters["speed"] == 1.0
    with pytest.raises(ParameterError, match="declared before"):
        parameters.declare("speed", 0.1)
    with pytest.raises(UnknownParameterError):
        parameters["sped"] = 1.0
    with pytest.raises(UnknownParameterError):
        _ = parameters["sped"]
    assert parameters.get("sped", 3) == 3
    assert "speed" in parameters
    assert (list(parameters), len(parameters), parameters.values()) == (["speed"], 1, {"speed": 1.0})


@pytest.mark.parametrize(
    ("rules", "why"),
    [
        ({"default": None}, "needs a parameter_type"),
        ({"default": []}, "an empty list"),
        ({"default": {}}, "no parameter value"),
        ({"default": "a", "minimum": 1}, "only integer and double"),
        ({"default": 1, "minimum": 0.5}, "in integers"),
        ({"default": 1, "minimum": 2, "maximum": 1}, "no range"),
        ({"default": 5, "maximum": 4}, "default: 5 is not within"),
        ({"default": 1, "choices": ("a",)}, "wrong type"),
        ({"default": "c", "choices": ("a", "b")}, "none of 'a', 'b'"),
    ],
)
def test_contradictory_declarations_are_refused(parameters, rules, why):
    with pytest.raises(ParameterError, match=why):
        parameters.declare("x", **rules)
    assert "x" not in parameters


def test_names_and_their_number_are_bounded(parameters):
    for wrong in ("", "a\n", "x" * 257, 3):
        with pytest.raises(ParameterError, match="name"):
            parameters.declare(wrong, 1)
    store = ParameterStore(allow_undeclared=True)
    assert store.set_atomically({f"p{n}": n for n in range(LIMITS.parameters_per_node)}).successful
    assert "4096" in store.set_atomically({"more": 1}).reason
    with pytest.raises(ParameterError, match="4096"):
        store.declare(ParameterDescriptor(name="more", kind=ParameterType.INTEGER), 1)


def test_steps_count_from_the_low_end_and_the_high_end_is_always_allowed():
    assert [v for v in range(11) if not Range(1, 10, 4).fault(v)] == [1, 5, 9, 10]
    assert not Range(0.0, 1.0, 0.1).fault(0.3)
    assert Range(0.0, 1.0, 0.1).fault(0.35)


@unhurried
@given(st.integers(0, 50), st.integers(1, 50), st.integers(0, 9), st.integers(-10, 110))
def test_an_integer_range_allows_exactly_its_steps(low, span, step, value):
    high = low + span
    allowed = low <= value <= high and (step == 0 or value == high or (value - low) % step == 0)
    assert (Range(low, high, step).fault(value) == "") is allowed


def test_read_only_choices_and_validate(parameters):
    parameters.declare("frame", "map", choices=("map", "odom"))
    parameters.declare("serial", "A1", read_only=True)
    parameters.declare("even", 2, validate=lambda v: v % 2 == 0)
    parameters.declare("named", 2, validate=lambda v: "" if v < 5 else "too many")

    def boom(_value: Any) -> None:
        if _value != 1:
            raise ValueError("not one")

    parameters.declare("one", 1, validate=boom)
    for name, value, why in (
        ("frame", "base", "none of"),
        ("serial", "B2", "read-only"),
        ("even", 3, "3 is not valid"),
        ("named", 7, "too many"),
        ("one", 2, "not one"),
        ("frame", None, "cannot be deleted"),
    ):
        with pytest.raises(ParameterError, match=f"{name}: .*{why}"):
            parameters[name] = value
    with pytest.raises(ParameterError, match="read-only"):
        parameters.undeclare("serial")
    assert parameters.describe("frame").words == "one of map, odom"


def test_a_set_is_atomic_with_a_reason_for_each(parameters):
    parameters.declare("a", 1, maximum=5)
    parameters.declare("b", 1.0)
    outcome = parameters.try_set({"a": 9, "b": "x", "c": 1})
    assert set(outcome.reasons) == {"a", "b", "c"}
    assert "a: 9 is not within" in outcome.reason
    assert parameters.values() == {"a": 1, "b": 1.0}
    parameters.set_atomically({"a": 5, "b": 2})
    assert parameters.values() == {"a": 5, "b": 2.0}
    assert not parameters.try_set({"b": 3}, exact=True).successful  # on the wire 3 is no double


def test_overrides_replace_defaults_and_must_fit():
    parameters = NodeParameters("/robot", overrides={"speed": 2, "name": 7})
    assert parameters.declare("speed", 0.5) == 2.0
    assert parameters.declare("late", parameter_type=float) is None
    assert parameters.describe("late").kind is ParameterType.DOUBLE
    with pytest.raises(ParameterError, match="name: override: wrong type: expected string, got integer"):
        parameters.declare("name", "x")
    assert parameters.declare("name", "x", ignore_override=True) == "x"


def test_dynamic_parameters_change_type_and_can_be_deleted(parameters):
    parameters.declare("any", dynamic_typing=True)
    assert parameters["any"] is None
    parameters["any"] = 1
    parameters["any"] = "text"
    parameters["any"] = None
    assert "any" not in parameters
    free = NodeParameters("/free", allow_undeclared=True)
    free["new"] = [1, 2]
    assert free["new"] == [1, 2]
    assert free.describe("new").dynamic_typing


def test_values_go_in_and_out_as_copies(parameters):
    gains = [1.0, 2.0]
    parameters.declare("gains", gains)
    gains[0] = 9.0
    parameters["gains"].append(3.0)
    assert parameters["gains"] == [1.0, 2.0]


def test_callbacks_see_sets_in_order_and_may_refuse(parameters):
    seen: list[Any] = []
    parameters.declare("a", 1)
    parameters.declare("b", 1)
    parameters.add_pre_set_callback(lambda values: values | {"b": 7} if "a" in values else None)
    parameters.add_on_set_callback(lambda values: "no nines" if 9 in values.values() else None)
    parameters.add_post_set_callback(lambda values: seen.append(values))
    parameters.on_change()(lambda name, value: seen.append((name, value)))
    parameters.on_change("b")(lambda value: seen.append(value))
    parameters["a"] = 2
    assert seen == [{"a": 2, "b": 7}, ("a", 2), ("b", 7), 7]
    seen.clear()
    parameters["b"] = 7
    assert seen == []  # nothing changed
    with pytest.raises(ParameterError, match=r"^no nines$"):
        parameters["a"] = 9
    parameters.add_on_set_callback(lambda values: False)
    with pytest.raises(ParameterError, match="refused by a callback"):
        parameters["a"] = 3


def test_a_failing_callback_refuses_before_and_is_logged_after(parameters, caplog):
    parameters.declare("a", 1)

    @parameters.on_change("a")
    def broken(value: int) -> None:
        raise RuntimeError("too late")

    parameters["a"] = 2
    assert "too late" in caplog.text
    parameters.add_on_set_callback(lambda values: parameters.set("a", 5))
    with pytest.raises(ParameterError, match="cannot be set while a set is being checked"):
        parameters["a"] = 3
    parameters.add_pre_set_callback(lambda values: 1 / 0)  # type: ignore[arg-type,return-value]
    with pytest.raises(ParameterError, match="division by zero"):
        parameters["a"] = 3
    assert parameters["a"] == 2


def test_changes_are_reported(parameters):
    reported: list[tuple[str, str]] = []
    parameters.notify = lambda changes: reported.extend((change.what, change.name) for change in changes)
    parameters.declare("a", 1)
    parameters["a"] = 1
    parameters.undeclare("a")
    parameters.declare("d", 1, dynamic_typing=True)
    parameters["d"] = None
    assert reported == [("new", "a"), ("changed", "a"), ("deleted", "a"), ("new", "d"), ("deleted", "d")]


def test_listing_follows_prefixes_and_depth(parameters):
    for name in ("a", "m.x", "m.y.z", "n.x", "mm"):
        parameters.declare(name, 1)
    store = parameters.store
    assert store.list() == (["a", "m.x", "m.y.z", "n.x", "mm"], ["m", "m.y", "n"])
    assert store.list(depth=1)[0] == ["a", "mm"]
    assert store.list(depth=2)[0] == ["a", "m.x", "n.x", "mm"]
    assert store.list(["m"])[0] == ["m.x", "m.y.z"]
    assert store.list(["m"], 1)[0] == ["m.x"]
    assert store.list(["a", "n"], 1)[0] == ["a", "n.x"]
    assert parameters.list("m", 1) == ["m.x"]


names = st.sampled_from(["a", "b", "c", "r", "z"])


@unhurried
@given(st.lists(st.dictionaries(names, st.one_of(st.integers(-9, 9), st.floats(), st.text(), st.none())), max_size=20))
def test_no_sequence_of_sets_breaks_the_rules(sets):
    store = ParameterStore()
    store.declare(ParameterDescriptor(name="a", kind=ParameterType.INTEGER, range=Range(-5, 5)), 0)
    store.declare(ParameterDescriptor(name="b", kind=ParameterType.DOUBLE, range=Range(0.0, 1.0)), 0.0)
    store.declare(ParameterDescriptor(name="c", kind=ParameterType.STRING, validate=lambda v: len(v) < 3), "")
    store.declare(ParameterDescriptor(name="r", kind=ParameterType.INTEGER, read_only=True), 1)
    for values in sets:
        before = {name: store.get(name) for name in store.names()}
        outcome = store.set_atomically(values)
        after = {name: store.get(name) for name in store.names()}
        if outcome.successful:
            assert after == before | values
        else:
            assert after == before
            assert set(outcome.reasons) <= set(values)
        assert type(after["a"]) is int
        assert -5 <= after["a"] <= 5
        assert type(after["b"]) is float
        assert 0.0 <= after["b"] <= 1.0
        assert len(after["c"]) < 3
        assert after["r"] == 1

"""The layout of the drawn graph: nothing overlaps, arcs avoid boxes, the same input gives the same picture."""

from __future__ import annotations

from itertools import combinations, pairwise
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.cli.graph.layers import columns_of
from metaros.cli.graph.layout import Box, Plan, Rect, lay_out
from tests.support.tables import cases

GROUPS = ("", "/arm", "/base", "/eye")


@st.composite
def graphs(build_graph_model: st.DrawFn) -> tuple[dict[str, Box], list[tuple[str, str]]]:
    """Up to 24 nodes and 24 topics, in any namespaces, linked in any way."""
    boxes: dict[str, Box] = {}
    for kind in ("n", "t"):
        for number in range(build_graph_model(st.integers(1, 24))):
            size = build_graph_model(st.integers(40, 200)), build_graph_model(st.integers(30, 80))
            boxes[f"{kind}{number}"] = Box(*size, build_graph_model(st.sampled_from(GROUPS)))
    nodes = st.sampled_from([key for key in boxes if key[0] == "n"])
    topics = st.sampled_from([key for key in boxes if key[0] == "t"])
    arcs = st.one_of(st.tuples(nodes, topics), st.tuples(topics, nodes))
    return boxes, build_graph_model(st.lists(arcs, max_size=60))


def apart(one: Rect, other: Rect) -> bool:
    """Whether two places share nothing."""
    beside = one.x + one.width <= other.x or other.x + other.width <= one.x
    return beside or one.y + one.height <= other.y or other.y + other.height <= one.y


def inside(one: Rect, other: Rect) -> bool:
    """Whether `one` lies in `other`."""
    return (
        other.x <= one.x
        and other.y <= one.y
        and one.x + one.width <= other.x + other.width + 0.01
        and one.y + one.height <= other.y + other.height + 0.01
    )


@settings(max_examples=30, deadline=None)
@given(graphs(), st.randoms(use_true_random=False))
def test_any_graph(graph: tuple[dict[str, Box], list[tuple[str, str]]], rng: Any) -> None:
    boxes, arcs = graph
    plan = lay_out(boxes, arcs)
    nothing_overlaps_and_frames_hold_their_own_only(plan, boxes)
    arcs_join_their_boxes_and_pass_the_others(plan, arcs)
    keys, mixed = list(boxes), list(arcs)
    rng.shuffle(keys)
    rng.shuffle(mixed)
    assert lay_out({key: boxes[key] for key in keys}, mixed) == plan


def nothing_overlaps_and_frames_hold_their_own_only(plan: Plan, boxes: dict[str, Box]) -> None:
    assert plan.boxes.keys() == boxes.keys()
    assert all(apart(one, other) for one, other in combinations(plan.boxes.values(), 2))
    assert all(apart(one, other) for one, other in combinations(plan.groups.values(), 2))
    for key, place in plan.boxes.items():
        assert inside(place, Rect(0, 0, plan.width, plan.height))
        for name, frame in plan.groups.items():
            assert (inside if boxes[key].group == name else apart)(place, frame)


def arcs_join_their_boxes_and_pass_the_others(plan: Plan, arcs: list[tuple[str, str]]) -> None:
    assert plan.routes.keys() == set(arcs)
    for (tail, head), route in plan.routes.items():
        for key, (x, y) in ((tail, route[0]), (head, route[-1])):
            place = plan.boxes[key]
            assert place.y < y < place.y + place.height
            assert min(abs(x - place.x), abs(x - place.x - place.width)) < 0.2
        for one, other in list(pairwise(route))[1::2]:  # level, through a column
            assert one[1] == other[1]
            assert not [key for key, place in plan.boxes.items() if crosses(one, other, place)]


def crosses(one: tuple[float, float], other: tuple[float, float], place: Rect) -> bool:
    """Whether a level line goes through a box."""
    left, right = sorted((one[0], other[0]))
    return place.y < one[1] < place.y + place.height and left < place.x + place.width and place.x < right


def test_a_chain_flows_from_left_to_right() -> None:
    plan = lay_out(dict.fromkeys("abc", Box(50, 30)), [("a", "b"), ("b", "c")])
    assert plan.boxes["a"].x < plan.boxes["b"].x < plan.boxes["c"].x
    assert len({place.y for place in plan.boxes.values()}) == 1


def test_what_nothing_leads_to_stands_before_its_reader() -> None:
    columns = columns_of(["n0", "t0", "n1", "t1"], [("n0", "t0"), ("t0", "n1"), ("t1", "n1")])
    assert columns == {"n0": 0, "t0": 1, "t1": 1, "n1": 2}


def test_long_circles_do_not_make_long_pictures() -> None:
    keys = [f"{'nt'[i % 2]}{i:02}" for i in range(40)]
    ring = [*pairwise(keys), (keys[-1], keys[0])]
    star = [(keys[0], keys[i]) for i in range(3, 40, 2)]
    assert max(columns_of(keys, [*ring, *star]).values()) < 9


def test_unlinked_parts_stand_beside_each_other() -> None:
    boxes = {f"{kind}{n}": Box(100, 200, f"/robot{n}") for n in range(4) for kind in "nt"}
    plan = lay_out(boxes, [(f"n{n}", f"t{n}") for n in range(4)])
    assert len({frame.x for frame in plan.groups.values()}) > 1
    assert len({frame.y for frame in plan.groups.values()}) > 1


@cases("boxes", [{}, {"alone": Box(50, 30, "/a")}])
def test_nothing_and_one(boxes: dict[str, Box]) -> None:
    assert isinstance(lay_out(boxes, []), Plan)

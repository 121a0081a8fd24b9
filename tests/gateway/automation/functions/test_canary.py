"""Canaries: weights that hold, roll-backs by error rate, steps, and a gateway that dies in between."""

from __future__ import annotations

import random  # noqa: TID251 - seeded
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest

from gateway.automation.functions.canary import Canaries
from gateway.automation.functions.directory import EventInvoke, Resolved
from gateway.automation.functions.errors import FunctionConflictError, FunctionInvalidError, UnknownFunctionError
from gateway.domain.automation.canary import PROMOTED, ROLLED_BACK, RUNNING, Canary, judged
from tests.gateway.automation.functions.calling import FakeDirectory
from tests.gateway.automation.queue.world import World

ASKED = Canary(
    function="f",
    alias="live",
    version="2",
    stable="1",
    weight=0.1,
    error_rate=0.05,
    least_invocations=20,
    for_s=60.0,
)
CHI_SQUARE_999 = 16.27  # three degrees of freedom, 0.1 %


def test_weights_are_what_calls_get() -> None:
    shares = {"1": 0.6, "2": 0.25, "3": 0.1, "4": 0.05}
    target, rng, count = Resolved("f", "live", "arn", tuple(shares.items())), random.Random(3), 20_000
    got = Counter(target.pick(rng.random()) for _ in range(count))
    chi = sum((got[version] - share * count) ** 2 / (share * count) for version, share in shares.items())
    assert chi < CHI_SQUARE_999
    assert target.pick(0.999999999999) == "4"


def test_it_is_rolled_back_as_soon_as_too_many_failed_but_not_before_enough_were_called() -> None:
    early = judged(ASKED, invocations=19, errors=19, now_ns=1)
    assert early.state == RUNNING
    late = judged(early, invocations=1, errors=0, now_ns=2)
    assert (late.state, late.applied) == (ROLLED_BACK, False)
    assert late.reason == "19 of 20 calls of version 2 failed, more than 5 %"
    assert late.weights == ("1", {})
    assert judged(ASKED, invocations=20, errors=1, now_ns=3).state == RUNNING


def test_without_errors_it_goes_on_by_steps_and_is_promoted() -> None:
    canary, seen = replace(ASKED, step=0.4), []
    for number in range(1, 5):
        canary = judged(canary, invocations=20, errors=0, now_ns=number * 61 * 10**9)
        seen.append((canary.state, round(canary.weight, 3), canary.invocations))
    assert seen == [(RUNNING, 0.5, 0), (RUNNING, 0.9, 0), (PROMOTED, 0.9, 20), (PROMOTED, 0.9, 20)]
    assert canary.weights == ("2", {})


def test_without_enough_calls_it_waits() -> None:
    assert judged(ASKED, invocations=19, errors=0, now_ns=10**15).state == RUNNING
    assert judged(ASKED, invocations=20, errors=0, now_ns=10**15).state == PROMOTED


class Scene:
    """Canaries of one gateway."""

    def __init__(self, world: World) -> None:
        self.clock = world.clock
        self.told: list[tuple[str, Mapping[str, Any]]] = []
        self.directory = FakeDirectory(functions={"f": EventInvoke()}, aliases={"f:live": (("1", 1.0),)})
        self._world = world
        self.canaries = self.make()

    def make(self) -> Canaries:
        """Another life of the gateway."""
        return Canaries(
            self._world.store(),
            self.directory,
            emit=lambda kind, robot, data: self.told.append((kind, data)),
            clock=self.clock,
        )

    def call(self, *, failed: int, good: int) -> None:
        """Calls of the new version."""
        for number in range(failed + good):
            self.canaries.count("f", "live", "2", number >= failed)


async def test_an_alias_is_moved_back_and_the_journal_says_why(world: World) -> None:
    scene = Scene(world)
    begun = await scene.canaries.begin(ASKED)
    assert (begun.stable, begun.applied) == ("1", True)
    assert scene.directory.aliases["f:live"] == (("1", 0.9), ("2", 0.1))
    with pytest.raises(FunctionConflictError):
        await scene.canaries.begin(ASKED)
    scene.canaries.count("f", "live", "1", False)  # of the old one: not its fault
    scene.call(failed=2, good=20)
    await scene.canaries.evaluate()
    found = scene.canaries.of("f", "live")
    assert found is not None
    assert (found.state, found.invocations, found.errors) == (ROLLED_BACK, 22, 2)
    assert scene.directory.aliases["f:live"] == (("1", 1.0),)
    assert [(kind, data["state"]) for kind, data in scene.told] == [
        ("function.canary", RUNNING),
        ("function.canary", ROLLED_BACK),
    ]
    again = await scene.canaries.begin(ASKED)
    assert again.state == RUNNING


@pytest.mark.parametrize("place", ["_read", "directory"])  # before the row is read again; while the alias is set
async def test_a_look_while_one_begins_tells_nothing_twice(
    world: World, place: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = Scene(world)
    holder, name = (FakeDirectory, "set_weights") if place == "directory" else (Canaries, place)
    go_on = getattr(holder, name)

    async def a_look_in_between(*args: Any, **options: Any) -> Any:
        monkeypatch.undo()
        await scene.canaries.evaluate()
        return await go_on(*args, **options)

    monkeypatch.setattr(holder, name, a_look_in_between)
    begun = await scene.canaries.begin(ASKED)
    assert (begun.state, begun.applied) == (RUNNING, True)
    assert [data["state"] for _, data in scene.told] == [RUNNING]
    assert scene.canaries.of("f", "live") == begun
    assert scene.directory.aliases["f:live"] == (("1", 0.9), ("2", 0.1))


async def test_what_was_decided_is_done_by_the_next_life(world: World) -> None:
    scene = Scene(world)
    await scene.canaries.begin(ASKED)
    scene.call(failed=20, good=0)
    apply = scene.canaries._apply

    async def dies(canary: Canary) -> Canary:
        raise RuntimeError("killed between the decision and the alias")

    scene.canaries._apply = dies  # type: ignore[method-assign]
    with pytest.raises(RuntimeError):
        await scene.canaries.evaluate()
    assert len(scene.directory.aliases["f:live"]) == 2
    scene.canaries = scene.make()
    await scene.canaries.evaluate()
    assert scene.directory.aliases["f:live"] == (("1", 1.0),)
    assert apply is not None


async def test_one_that_is_good_is_promoted_after_its_time(world: World) -> None:
    scene = Scene(world)
    await scene.canaries.begin(ASKED)
    scene.call(failed=0, good=30)
    await scene.canaries.evaluate()
    scene.clock.advance(61)
    await scene.canaries.evaluate()
    assert scene.directory.aliases["f:live"] == (("2", 1.0),)


async def test_it_can_be_cancelled_once(world: World) -> None:
    scene = Scene(world)
    await scene.canaries.begin(ASKED)
    ended = await scene.canaries.cancel("f", "live", by="ann")
    assert ended.reason == "cancelled by ann"
    assert scene.directory.aliases["f:live"] == (("1", 1.0),)
    with pytest.raises(UnknownFunctionError):
        await scene.canaries.cancel("f", "live", by="ann")


async def test_what_cannot_be_is_refused(world: World) -> None:
    scene = Scene(world)
    with pytest.raises(FunctionInvalidError):
        await scene.canaries.begin(replace(ASKED, version="1"))
    with pytest.raises(UnknownFunctionError):
        await scene.canaries.begin(replace(ASKED, function="none"))


async def test_a_canary_of_a_deleted_function_is_forgotten(world: World) -> None:
    scene = Scene(world)
    await scene.canaries.begin(ASKED)
    del scene.directory.functions["f"]
    scene.call(failed=20, good=0)
    with pytest.raises(UnknownFunctionError):
        await scene.canaries.evaluate()
    await scene.canaries.evaluate()
    assert scene.canaries.of("f", "live") is None

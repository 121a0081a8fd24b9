"""Events for functions on a manual clock: retries, ages, dead letters and destinations, as Lambda has them."""

from __future__ import annotations

import random  # noqa: TID251 - seeded
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass, field

from gateway.automation.functions.async_invoke import EventHandler
from gateway.automation.functions.async_put import FUNCTION
from gateway.automation.functions.destination_handler import OWN_BUS, DestinationHandler
from gateway.automation.functions.destinations import DESTINATION, MOST_HOPS
from gateway.automation.functions.directory import EventInvoke
from gateway.automation.functions.errors import FunctionsOffError
from gateway.automation.functions.invoker import Invoker
from gateway.automation.queue.manager import QueueManager
from gateway.domain.automation.delivery import DeadFilter
from gateway.domain.automation.gateway_event import GatewayEvent
from metaros.automation.functions.calls import FunctionSpec, Invocation, Outcome
from metaros.automation.functions.errors import EngineClosedError, ThrottledError
from tests.gateway.automation.functions.calling import (
    FakeAws,
    FakeDirectory,
    FakeEngine,
    failed,
    make_invoker,
    returned,
)
from tests.gateway.automation.queue.world import World

QUEUE = "arn:aws:sqs:eu-central-1:123456789012:ends"
DLQ = "arn:aws:sqs:eu-central-1:123456789012:dead"
S = 10**9


@dataclass(slots=True)
class Scene:
    """A queue with functions behind it."""

    world: World
    manager: QueueManager
    invoker: Invoker
    engine: FakeEngine
    directory: FakeDirectory
    aws: FakeAws = field(default_factory=FakeAws)
    happened: list[GatewayEvent] = field(default_factory=list)

    async def put_events(self, gateway_events: Sequence[GatewayEvent]) -> object:
        """Kept."""
        self.happened.extend(gateway_events)
        return len(gateway_events)

    async def drive_after(self, seconds: float) -> int:
        """Some time later: how often the function was called."""
        before = len(self.engine.calls)
        self.world.clock.advance(seconds)
        await self.world.drive(self.manager)
        return len(self.engine.calls) - before


async def make_scene(world: World, settings: EventInvoke, act: Callable[..., Awaitable[Outcome]]) -> Scene:
    """One function `f` that does `act`."""
    store = world.store()
    manager = QueueManager(store, clock=world.clock, rng=random.Random(1))
    engine, directory = FakeEngine(act=act), FakeDirectory(functions={"f": settings})
    invoker, _ = make_invoker(store, engine, directory, manager.accept, clock=world.clock)
    scene = Scene(world, manager, invoker, engine, directory)
    manager.handle(FUNCTION, EventHandler(invoker, directory, clock=world.clock))
    manager.handle(DESTINATION, DestinationHandler(scene.aws, scene.put_events, clock=world.clock))
    await manager.start()
    world._managers.append(manager)
    return scene


async def fails(spec: FunctionSpec, call: Invocation) -> Outcome:
    """Always."""
    return failed()


async def goes(spec: FunctionSpec, call: Invocation) -> Outcome:
    """Always."""
    return returned({"took": call.payload.decode()})


async def test_an_error_is_tried_again_after_one_and_two_minutes_and_then_reported(world: World) -> None:
    scene = await make_scene(world, EventInvoke(on_failure=QUEUE, dead_letter=DLQ), fails)
    request_id = await scene.invoker.accept("f", "", b'{"n": 1}')
    assert await scene.drive_after(0) == 1
    assert await scene.drive_after(59) == 0
    assert await scene.drive_after(1) == 1
    assert await scene.drive_after(119) == 0
    assert await scene.drive_after(1) == 1
    assert await scene.drive_after(6 * 3600) == 0
    assert {call.request_id for _, call in scene.engine.calls} == {request_id}
    (letter,) = await scene.manager.dead_page(DeadFilter(), limit=9)
    assert (letter.code, letter.message, letter.attempts) == ("function_error", "ValueError: no", 3)
    by_arn = {arn: (body, facts) for arn, body, facts in scene.aws.sent}
    assert set(by_arn) == {QUEUE, DLQ}
    record = by_arn[QUEUE][0]
    assert record["requestContext"] == {
        "requestId": request_id,
        "functionArn": "arn:aws:lambda:local:000000000000:function:f:$LATEST",
        "condition": "RetriesExhausted",
        "approximateInvokeCount": 3,
    }
    assert record["requestPayload"] == {"n": 1}
    assert record["responseContext"] == {
        "statusCode": 200,
        "executedVersion": "$LATEST",
        "functionError": "Unhandled",
    }
    assert record["responsePayload"]["errorType"] == "ValueError"
    assert record["version"] == "1.0"
    assert record["timestamp"].endswith("Z")
    assert by_arn[DLQ][0] == {"n": 1}
    assert by_arn[DLQ][1]["attributes"]["RequestID"] == request_id
    assert by_arn[DLQ][1]["attributes"]["ErrorMessage"] == "ValueError: no"


async def test_no_retries_where_the_settings_say_so(world: World) -> None:
    scene = await make_scene(world, EventInvoke(most_retries=0), fails)
    await scene.invoker.accept("f", "", b"1")
    assert await scene.drive_after(0) == 1
    assert await scene.drive_after(1000) == 0
    assert len(await scene.manager.dead_page(DeadFilter(), limit=9)) == 1
    assert scene.aws.sent == []


async def test_a_throttle_costs_no_attempt(world: World) -> None:
    full = True

    async def act(spec: FunctionSpec, call: Invocation) -> Outcome:
        if full:
            raise ThrottledError("full")
        return await goes(spec, call)

    scene = await make_scene(world, EventInvoke(most_retries=0), act)
    await scene.invoker.accept("f", "", b"1")
    assert sum([await scene.drive_after(30) for _ in range(40)]) > 3
    full = False
    while not await scene.drive_after(30):
        pass
    assert await scene.manager.dead_page(DeadFilter(), limit=9) == []


async def test_an_event_that_finds_no_room_is_given_up_when_it_is_too_old(world: World) -> None:
    async def act(spec: FunctionSpec, call: Invocation) -> Outcome:
        raise ThrottledError("full")

    scene = await make_scene(world, EventInvoke(most_age_s=600.0, on_failure=QUEUE), act)
    await scene.invoker.accept("f", "", b"3")
    for _ in range(19):
        await scene.drive_after(30)
    assert scene.aws.sent == []
    await scene.drive_after(31)
    await scene.drive_after(1)
    (letter,) = await scene.manager.dead_page(DeadFilter(), limit=9)
    assert letter.code == "too_old"
    ((_, record, _),) = scene.aws.sent
    assert record["requestContext"]["condition"] == "EventAgeExceeded"
    assert record["requestPayload"] == 3
    assert "responseContext" not in record


async def test_what_is_too_large_for_a_record_is_left_out_of_it(world: World) -> None:
    async def act(spec: FunctionSpec, call: Invocation) -> Outcome:
        return returned("x" * 2_000_000)

    scene = await make_scene(world, EventInvoke(on_success=QUEUE), act)
    await scene.invoker.accept("f", "", b"1")
    await scene.drive_after(0)
    ((_, record, _),) = scene.aws.sent
    assert record["responsePayload"]["omitted"]["reason"] == "too_large"
    assert record["requestPayload"] == 1


async def test_success_is_reported_to_a_function_of_ones_own(world: World) -> None:
    own = "arn:aws:lambda:local:000000000000:function:next"
    scene = await make_scene(world, EventInvoke(on_success=own), goes)
    scene.directory.functions["next"] = EventInvoke()
    await scene.invoker.accept("f", "", b'{"a": 1}')
    assert await scene.drive_after(0) == 2
    record = scene.engine.calls[1][1].payload
    assert b'"condition":"Success"' in record
    assert b'"responsePayload":{"took"' in record
    assert await scene.drive_after(100) == 0


async def test_functions_that_tell_each_other_for_ever_are_stopped(world: World) -> None:
    own = "arn:aws:lambda:local:000000000000:function:f"

    async def act(spec: FunctionSpec, call: Invocation) -> Outcome:
        return returned("again")

    scene = await make_scene(world, EventInvoke(on_success=own), act)
    await scene.invoker.accept("f", "", b"1")
    assert await scene.drive_after(0) == MOST_HOPS + 1


async def test_the_gateways_own_bus_takes_records_as_events(world: World) -> None:
    scene = await make_scene(world, EventInvoke(on_success=OWN_BUS), goes)
    await scene.invoker.accept("f", "", b"1", robot="r1")
    await scene.drive_after(0)
    (gateway_event,) = scene.happened
    assert (gateway_event.type, gateway_event.source) == ("Lambda Function Invocation Result - Success", "lambda")
    assert (gateway_event.robot, gateway_event.data["requestPayload"]) == ("r1", 1)


async def test_a_destination_that_is_away_is_tried_again(world: World) -> None:
    scene = await make_scene(world, EventInvoke(on_success=QUEUE), goes)
    scene.aws.trouble = "no route"
    await scene.invoker.accept("f", "", b"1")
    await scene.drive_after(0)
    scene.aws.trouble = ""
    while not scene.aws.sent:
        await scene.drive_after(300)
    assert len(scene.aws.sent) == 1


async def test_an_unknown_function_is_a_dead_letter_that_can_be_driven_again(world: World) -> None:
    scene = await make_scene(world, EventInvoke(), goes)
    await scene.invoker.accept("f", "", b"1")
    del scene.directory.functions["f"]
    assert await scene.drive_after(0) == 0
    (letter,) = await scene.manager.dead_page(DeadFilter(), limit=9)
    assert letter.code == "unknown_function"
    scene.directory.functions["f"] = EventInvoke()
    assert await scene.manager.redrive(DeadFilter()) == 1
    assert await scene.drive_after(5) == 1


async def test_an_engine_that_ends_or_is_off_costs_no_attempt(world: World) -> None:
    troubles: list[Exception] = [EngineClosedError("ends"), FunctionsOffError("off")]

    async def act(spec: FunctionSpec, call: Invocation) -> Outcome:
        if troubles:
            raise troubles.pop(0)
        return await goes(spec, call)

    scene = await make_scene(world, EventInvoke(most_retries=0), act)
    await scene.invoker.accept("f", "", b"1")
    calls = await scene.drive_after(0)
    while calls < 3:
        calls += await scene.drive_after(10)
    assert await scene.manager.dead_page(DeadFilter(), limit=9) == []


async def test_a_gateway_without_functions_takes_none() -> None:
    handler = EventHandler(None, FakeDirectory(), on=False, clock=None)  # type: ignore[arg-type]
    assert handler.room() == handler.room("f") == 0

"""Calls at a gateway that runs no functions: a peer runs them, and its answers and errors come back as they are."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from typing import Any

import pytest

from gateway.automation.functions.async_invoke import EventHandler
from gateway.automation.functions.errors import FunctionsOffError, UnknownFunctionError
from gateway.automation.functions.invoker import Call, Invoked
from gateway.cluster.function_requests import FunctionRequests
from metaros.automation.functions.calls import Outcome
from metaros.automation.functions.errors import RESERVED_FULL, EngineClosedError, ThrottledError
from metaros.clock import ManualClock
from metaros.errors import TooLargeError
from metaros.limits import LIMITS
from tests.support.gateways.fake_mesh import FakeMeshes
from tests.support.gateways.relay_rig import settle

DONE = Invoked(
    Outcome(
        payload=b"\0\1", error_type="E", duration_ms=1.5, init_ms=2, max_memory_mb=64, log=b"log", content_type="a/b"
    ),
    "7",
    "req",
)


class Runner:
    """An invoker: answers or raises what the test says."""

    def __init__(self, answer: Invoked | Exception = DONE) -> None:
        self.answer, self.remote = answer, None
        self.calls: list[tuple[Any, ...]] = []

    async def invoke(self, function: str, qualifier: str, payload: bytes, **call: Any) -> Invoked:
        self.calls.append((function, qualifier, payload, call))
        await asyncio.sleep(0)
        if isinstance(self.answer, Exception):
            raise self.answer
        return self.answer


class Rig:
    """Gateway "a" runs none, each of the others does."""

    def __init__(self, *answers: Invoked | Exception) -> None:
        self.meshes = FakeMeshes()
        self.off = Runner()
        self.function_requests = FunctionRequests(self.meshes.join("a"), self.off, on=False)
        self.runners = {f"r{number}": Runner(answer) for number, answer in enumerate(answers)}
        self.parts = [
            FunctionRequests(self.meshes.join(name), runner, on=True) for name, runner in self.runners.items()
        ]

    async def invoke(self, payload: bytes = b"{}", **call: Any) -> Invoked:
        await settle()
        return await self.function_requests.invoke("f", "live", payload, Call(**call))


async def test_a_call_is_run_by_a_peer_and_its_whole_answer_comes_back() -> None:
    rig = Rig(DONE)
    assert rig.off.remote == rig.function_requests.invoke
    payload = bytes(LIMITS.function_payload_bytes)
    assert await rig.invoke(payload, kind="test", robot="r1", trace_id="t", client_context="{}") == DONE
    ((function, qualifier, came, call),) = rig.runners["r0"].calls
    assert (function, qualifier, came) == ("f", "live", payload)
    assert call == {"kind": "test", "robot": "r1", "request_id": "", "client_context": "{}", "trace_id": "t"}


@pytest.mark.parametrize(
    "error",
    [
        UnknownFunctionError("no such function"),
        TooLargeError("too large"),
        EngineClosedError("it ends"),
        ThrottledError("full", reason=RESERVED_FULL),
        FunctionsOffError("cannot start"),
    ],
)
async def test_errors_of_the_peer_are_raised_as_what_they_are(error: Exception) -> None:
    rig = Rig(error)
    with pytest.raises(type(error), match=str(error)) as caught:
        await rig.invoke()
    assert getattr(caught.value, "reason", "") == getattr(error, "reason", "")


async def test_without_a_peer_that_runs_functions_it_says_so() -> None:
    rig = Rig()
    with pytest.raises(FunctionsOffError, match="no gateway of this store runs functions"):
        await rig.invoke()
    FunctionRequests(rig.meshes.join("b"), Runner(), on=False)
    with pytest.raises(FunctionsOffError):
        await rig.invoke()


async def test_calls_go_to_the_peer_that_has_least_to_do() -> None:
    rig = Rig(DONE, replace(DONE, version="8"))
    await settle()
    found = await asyncio.gather(*(rig.invoke() for _ in range(10)))
    assert sorted(item.version for item in found) == ["7"] * 5 + ["8"] * 5


async def test_a_peer_that_dies_is_asked_no_more_and_its_callers_hear_it() -> None:
    rig = Rig(DONE)
    await settle()

    async def never(*args: Any, **call: Any) -> Invoked:
        await asyncio.Event().wait()
        return DONE

    rig.runners["r0"].invoke = never  # type: ignore[method-assign]
    running = asyncio.create_task(rig.invoke())
    await settle()
    rig.meshes.leave("r0")
    with pytest.raises(FunctionsOffError, match="went before it answered"):
        await running
    with pytest.raises(FunctionsOffError, match="no gateway"):
        await rig.invoke()


def test_a_gateway_without_functions_leases_no_events_for_them() -> None:
    nobody: Any = None
    assert EventHandler(nobody, nobody, on=False, clock=ManualClock()).room() == 0
    assert EventHandler(nobody, nobody, on=True, clock=ManualClock()).room() > 0


async def test_calls_leave_room_for_other_questions() -> None:
    rig = Rig(DONE)
    most = LIMITS.cluster_asks // 2
    await settle()
    done = await asyncio.gather(*(rig.invoke() for _ in range(most + 3)), return_exceptions=True)
    assert done.count(DONE) == most
    assert sum(isinstance(one, ThrottledError) for one in done) == 3
    assert await rig.invoke() == DONE, "there is room again"

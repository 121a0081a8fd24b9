"""From the backlog to the handler and back: leased, called, what it asks for done, settled; tried again, or dead."""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import json
import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, Protocol

from metaros.automation.functions.calls import FunctionSpec, Invocation, Outcome
from metaros.automation.functions.errors import EngineClosedError, ThrottledError
from metaros.automation.robot.actions import Action, ActionError
from metaros.automation.robot.backlog import Backlog, Event
from metaros.automation.robot.manifest import RobotFunction
from metaros.clock import Clock
from metaros.errors import MetarosError
from metaros.limits import LIMITS, Limits

__all__ = ["ActionFunction", "Invoke", "Reader", "Rng", "Runner"]

LOG = logging.getLogger("metaros.robot_functions")
LOSSES: Final = 5  # ends of this program that an event may be at hand in; then it is dead, lest it be their cause
BACKOFF_S: Final = (1.0, 300.0)
THROTTLED_S: Final = 1.0
IDLE_S: Final = 60.0


class Invoke(Protocol):
    """The engine's."""

    async def __call__(self, spec: FunctionSpec, call: Invocation) -> Outcome:
        """Run a call to its end."""


class Reader(Protocol):
    """`read_actions` of this robot."""

    def __call__(self, returned: Any) -> tuple[Action, ...]:
        """What an answer asks for. Raises ActionError."""


class ActionFunction(Protocol):
    """`ActionExecutor.do`: blocks."""

    def __call__(self, action: Action) -> dict[str, Any]:
        """One action. Raises MetarosError."""


class Rng(Protocol):
    """Chance."""

    def uniform(self, a: float, b: float) -> float:
        """Between the two."""


@dataclass(frozen=True, slots=True)
class _End:
    """How an attempt ended. `failure` "" is well; with `final` trying again changes nothing."""

    result: dict[str, Any]
    failure: str = ""
    final: bool = False


class Runner:
    """`run` it on the event loop; `wake` it where there is more to do."""

    def __init__(
        self,
        function: RobotFunction,
        spec: FunctionSpec,
        backlog: Backlog,
        invoke: Invoke,
        *,
        read: Reader,
        do: ActionFunction,
        robot: str,
        clock: Clock,
        rng: Rng,
        settled: Callable[[], None] = lambda: None,
        limits: Limits = LIMITS,
    ) -> None:
        """`settled` is called on the loop for each attempt that is over: there is a result."""
        self._function, self._spec, self._backlog, self._invoke = function, spec, backlog, invoke
        self._read, self._do, self._robot = read, do, robot
        self._clock, self._rng, self._settled, self._limits = clock, rng, settled, limits
        self._wake = asyncio.Event()
        self._turns = asyncio.Lock()  # of actions: one call's after the other's
        self._tasks: set[asyncio.Task[None]] = set()

    def wake(self) -> None:
        """On the loop: look again."""
        self._wake.set()

    async def run(self) -> None:
        """Until cancelled; what is at hand then waits on the disk for the next life."""
        lost = await asyncio.to_thread(self._backlog.recover)
        if lost:
            LOG.warning("%d events were at hand when the last life ended: they are tried again", lost)
        try:
            while True:
                self._wake.clear()
                await self.run_due()
                await self._rest()
        finally:
            for task in self._tasks:
                task.cancel()
            await asyncio.gather(*self._tasks, return_exceptions=True)

    async def run_due(self) -> None:
        """Begin what is due, as far as concurrency allows."""
        free = self._function.concurrency - len(self._tasks)
        if free <= 0:
            return
        for event in await asyncio.to_thread(self._backlog.lease, free, now_ns=self._clock.wall_ns()):
            task = asyncio.create_task(self.handle(event))
            self._tasks.add(task)
            task.add_done_callback(self._ended)

    async def handle(self, event: Event) -> None:
        """One attempt of one event, to its settlement."""
        began_ns = self._clock.wall_ns()
        age_s = (began_ns - event.born_ns) / 1e9
        if event.losses >= LOSSES:
            end = _End(_failed("lost", f"{LOSSES} lives of this program ended with it"), "lost", final=True)
        elif age_s > self._function.retry.max_age_s:
            end = _End(_failed("too_old", f"it has waited for {age_s:.0f} s"), "too_old", final=True)
        else:
            try:
                end = await self._attempt(event)
            except (ThrottledError, EngineClosedError) as error:
                LOG.debug("%s is not tried now: %s", event.name, error)
                again_ns = self._clock.wall_ns() + round(THROTTLED_S * 1e9)
                await asyncio.to_thread(self._backlog.put_back, event, again_ns=again_ns)
                return
        await self._settle(event, began_ns, end)

    async def _attempt(self, event: Event) -> _End:
        call = Invocation(request_id=_request_id(self._robot, event), payload=event.payload, arn=self._spec.arn)
        outcome = await self._invoke(self._spec, call)
        said = _said(outcome, self._limits.robot_result_bytes)
        if not outcome.ok:
            return _End(said, outcome.error_type)
        try:
            actions = self._read(_answer(outcome.payload))
        except ActionError as error:
            return _End(said | _failed(error.code, str(error)), error.code, final=True)
        done: list[dict[str, Any]] = []
        async with self._turns:
            for action in actions:
                try:
                    done.append(await asyncio.to_thread(self._do, action))
                except MetarosError as error:
                    done.append({"kind": action.kind, "name": action.name, "error": str(error)[:500]})
                    return _End(said | _failed(error.code, str(error)) | {"actions": done}, error.code)
        return _End(said | {"actions": _bounded(done, self._limits.robot_result_bytes)})

    async def _settle(self, event: Event, began_ns: int, end: _End) -> None:
        last = end.final or event.attempts >= self._function.retry.attempts
        dead = end.failure if last else ""
        again_ns = 0
        if end.failure and not last:
            most_s = min(BACKOFF_S[1], BACKOFF_S[0] * 2.0**event.attempts)
            again_ns = self._clock.wall_ns() + round(self._rng.uniform(BACKOFF_S[0] / 2, most_s) * 1e9)
        result = {
            "id": _request_id(self._robot, event),
            "function": self._function.name,
            "version": self._spec.version,
            "robot": self._robot,
            "trigger": event.trigger,
            "event": event.name,
            "status": "dead" if dead else "error" if end.failure else "ok",
            "attempt": event.attempts,
            "losses": event.losses,
            "began_ns": began_ns,
            **end.result,
        }
        settle = self._backlog.settle
        await asyncio.to_thread(settle, event, result, again_ns=again_ns, dead=dead)
        self._settled()
        if end.failure:
            LOG.warning("%s, attempt %d: %s", event.name, event.attempts, end.result.get("error_message", end.failure))

    def _ended(self, task: asyncio.Task[None]) -> None:
        self._tasks.discard(task)
        self._wake.set()
        if not task.cancelled() and task.exception() is not None:  # the disk: its event waits for the next life
            LOG.error("an event could not be settled: %s", task.exception())

    async def _rest(self) -> None:
        """Until there is something to do."""
        due_ns = await asyncio.to_thread(self._backlog.next_due_ns)
        full = len(self._tasks) >= self._function.concurrency
        wait_s = IDLE_S
        if due_ns is not None and not full:
            wait_s = min(IDLE_S, max(0.0, (due_ns - self._clock.wall_ns()) / 1e9))
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(wait_s):
                await self._wake.wait()


def _request_id(robot: str, event: Event) -> str:
    """The same in each attempt, and in each life."""
    digest = hashlib.sha256(f"{robot}\n{event.trigger}\n{event.name}".encode()).hexdigest()
    return f"{digest[:8]}-{digest[8:12]}-{digest[12:16]}-{digest[16:20]}-{digest[20:32]}"


def _answer(payload: bytes) -> Any:
    try:
        return json.loads(payload) if payload else None
    except ValueError:
        return None


def _said(outcome: Outcome, most_bytes: int) -> dict[str, Any]:
    """What an outcome adds to the result."""
    said: dict[str, Any] = {
        "duration_ms": round(outcome.duration_ms, 3),
        "init_ms": round(outcome.init_ms, 3),
        "max_memory_mb": outcome.max_memory_mb,
    }
    answer = _answer(outcome.payload)
    if outcome.ok:
        fits = len(outcome.payload) <= most_bytes
        return said | ({"payload": answer} if fits else {"omitted": {"size_bytes": len(outcome.payload)}})
    message = answer.get("errorMessage", "") if isinstance(answer, dict) else ""
    return said | _failed(outcome.error_type, str(message))


def _bounded(done: list[dict[str, Any]], most_bytes: int) -> list[dict[str, Any]]:
    """What was done; without what services answered, where that is too much."""
    if len(json.dumps(done)) <= most_bytes:
        return done
    return [{key: action[key] for key in ("kind", "name")} for action in done]


def _failed(error_type: str, message: str) -> dict[str, Any]:
    return {"error_type": error_type, "error_message": message[:1000]}

"""Functions that do as they are told: an engine and a catalogue of tests, with everything of ours between them real."""

from __future__ import annotations

import random  # noqa: TID251 - seeded
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import orjson

from gateway.automation.functions.directory import EventInvoke, MappingRow, Resolved
from gateway.automation.functions.errors import UnknownFunctionError
from gateway.automation.functions.invoker import Invoker
from gateway.automation.functions.ledger import Ledger
from gateway.automation.functions.meters import FunctionMeters
from gateway.domain.automation.delivery import Put
from gateway.store import Store
from metaros.automation.functions.calls import FunctionSpec, Invocation, Outcome
from metaros.clock import ManualClock

__all__ = ["FakeAws", "FakeDirectory", "FakeEngine", "failed", "make_invoker", "returned"]


def returned(value: Any = None, **more: Any) -> Outcome:
    """A handler's answer."""
    return Outcome(payload=orjson.dumps(value), duration_ms=2.0, **more)


def failed(error_type: str = "ValueError", message: str = "no") -> Outcome:
    """A handler that raised."""
    document = {"errorType": error_type, "errorMessage": message}
    return Outcome(payload=orjson.dumps(document), error_type=error_type, duration_ms=2.0)


async def _null(spec: FunctionSpec, call: Invocation) -> Outcome:
    return returned()


@dataclass(slots=True)
class FakeEngine:
    """Runs `act`; what it raises is what an engine refuses."""

    act: Callable[[FunctionSpec, Invocation], Awaitable[Outcome]] = _null
    calls: list[tuple[str, Invocation]] = field(default_factory=list)

    async def invoke(self, spec: FunctionSpec, call: Invocation) -> Outcome:
        """As told."""
        self.calls.append((spec.version, call))
        return await self.act(spec, call)

    async def stream(self, spec: FunctionSpec, call: Invocation) -> AsyncIterator[bytes | Outcome]:
        """In one piece."""
        outcome = await self.invoke(spec, call)
        if outcome.ok:
            yield outcome.payload
        yield outcome


@dataclass(slots=True)
class FakeDirectory:
    """Functions by name, with aliases as `versions` of `name:alias`."""

    functions: dict[str, EventInvoke] = field(default_factory=dict)
    aliases: dict[str, tuple[tuple[str, float], ...]] = field(default_factory=dict)
    rows: list[MappingRow] = field(default_factory=list)
    results: dict[str, str] = field(default_factory=dict)
    listeners: list[Callable[[str], None]] = field(default_factory=list)

    def resolve(self, name: str, qualifier: str = "") -> Resolved:
        """By name."""
        if name not in self.functions:
            raise UnknownFunctionError(f"there is no function {name}")
        arn = f"arn:aws:lambda:local:000000000000:function:{name}" + (f":{qualifier}" if qualifier else "")
        versions = self.aliases.get(f"{name}:{qualifier}", ((qualifier or "$LATEST", 1.0),))
        return Resolved(name, qualifier, arn, versions)

    async def spec(self, name: str, version: str) -> FunctionSpec:
        """One that is never unpacked."""
        key = f"{name}:{version}"
        return FunctionSpec(
            key=key, name=name, version=version, arn=key, handler="app.handler", code_dir=Path("/nowhere")
        )

    def names(self) -> list[str]:
        """All."""
        return sorted(self.functions)

    def event_invoke(self, name: str, qualifier: str) -> EventInvoke:
        """As told."""
        return self.functions.get(name, EventInvoke())

    def mappings(self) -> Sequence[MappingRow]:
        """As told."""
        return self.rows

    def note_mapping(self, uuid: str, result: str) -> None:
        """Kept."""
        self.results[uuid] = result

    async def set_weights(self, name: str, alias: str, version: str, weights: Mapping[str, float], *, by: str) -> None:
        """As asked."""
        self.resolve(name)
        self.aliases[f"{name}:{alias}"] = ((version, 1.0 - sum(weights.values())), *weights.items())

    async def files(self, name: str, version: str) -> Path:
        """None."""
        return Path("/nowhere")

    def on_change(self, listener: Callable[[str], None]) -> None:
        """Kept."""
        self.listeners.append(listener)


@dataclass(slots=True)
class FakeAws:
    """Keeps what is sent; `trouble` is why it is not."""

    sent: list[tuple[str, dict[str, Any], dict[str, Any]]] = field(default_factory=list)
    trouble: str = ""

    async def send(self, arn: str, payload: bytes, facts: Mapping[str, Any]) -> str:
        """Kept."""
        if self.trouble:
            raise ConnectionError(self.trouble)
        self.sent.append((arn, orjson.loads(payload), dict(facts)))
        return "1"


def make_invoker(
    store: Store,
    engine: FakeEngine,
    directory: FakeDirectory,
    accept: Callable[[Sequence[Put]], Awaitable[Sequence[str]]],
    *,
    clock: ManualClock,
    seed: int = 1,
) -> tuple[Invoker, Ledger]:
    """A real one, and the record of its calls."""
    ledger = Ledger(store, FunctionMeters(clock=clock), clock=clock)
    return Invoker(engine, directory, ledger, accept=accept, clock=clock, rng=random.Random(seed)), ledger

"""Replays into functions: what of a span is given to which, rebuilt from what is stored of a replay."""

from __future__ import annotations

import uuid
from collections.abc import Awaitable, Callable, Iterable, Sequence
from typing import Any

import orjson

from gateway.automation.functions.async_put import event_put
from gateway.automation.functions.directory import Directory
from gateway.domain.automation.delivery import Put
from gateway.domain.automation.gateway_event import GatewayEvent, Replay
from gateway.domain.automation.shapes import eventbridge
from metaros.automation.rules.pattern import compile_pattern

__all__ = ["Replayer"]

Begin = Callable[[Replay, Callable[[GatewayEvent], bool], Callable[[GatewayEvent], Sequence[Put]]], Awaitable[Replay]]


class Replayer:
    """Begins replays, and goes on with those that a restart left."""

    def __init__(self, begin: Begin, directory: Directory) -> None:
        """`begin` is the queue's."""
        self._begin = begin
        self._directory = directory

    async def begin(self, replay: Replay) -> Replay:
        """Begin one, or go on with it. Raises UnknownFunctionError, PatternError, TooManyError, StoreError."""
        spec: dict[str, Any] = dict(replay.spec)
        target = self._directory.resolve(str(spec["function"]), str(spec.get("qualifier", "")))
        settings = self._directory.event_invoke(target.name, target.qualifier)
        pattern = compile_pattern(spec["pattern"]) if spec.get("pattern") else None

        def match(gateway_event: GatewayEvent) -> bool:
            return pattern is None or pattern.matches(eventbridge(gateway_event))

        def put(gateway_event: GatewayEvent) -> Sequence[Put]:
            event = event_put(
                target.name,
                target.qualifier,
                orjson.dumps(eventbridge(gateway_event)),
                request_id=str(
                    uuid.uuid5(uuid.NAMESPACE_OID, f"{replay.id}/{gateway_event.source}/{gateway_event.id}")
                ),
                settings=settings,
                robot=gateway_event.robot,
                event_id=gateway_event.id,
            )
            return (event,)

        return await self._begin(replay, match, put)

    async def resume(self, replays: Iterable[Replay]) -> None:
        """Go on with those that have not ended."""
        for replay in replays:
            if not replay.ended_ns and "function" in replay.spec:
                await self.begin(replay)

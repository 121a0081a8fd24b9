"""A call on its way through the engine: from its admission to its Outcome."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from dataclasses import dataclass

from metaros.automation.functions.calls import FunctionSpec, Invocation, Outcome
from metaros.automation.functions.response_stream import ResponseStream
from metaros.automation.functions.runtime.runtime_api import Answer

__all__ = ["RunningCall", "platform_error"]


def platform_error(request_id: str, error_type: str, message: str) -> Answer:
    """An error that is not the handler's own words."""
    text = f"RequestId: {request_id} Error: {message}"
    return Answer(json.dumps({"errorType": error_type, "errorMessage": text}).encode(), error_type)


@dataclass(slots=True, eq=False)
class RunningCall:
    """One call. `over` is called once, when it has its end, whoever still listens."""

    spec: FunctionSpec
    call: Invocation
    done: asyncio.Future[Outcome]
    over: Callable[[RunningCall], None]
    stream: ResponseStream | None
    asked_s: float  # on the event loop's clock
    began_s: float = 0.0  # on the engine's
    init_ms: float = 0.0

    def settle(self, outcome: Outcome) -> None:
        """It has come to its end."""
        self.over(self)
        if self.stream is not None:
            self.stream.end(outcome)
        if not self.done.done():
            self.done.set_result(outcome)

    def fail(self, error: Exception) -> None:
        """It was not done, or nobody knows."""
        self.over(self)
        if not self.done.done():
            self.done.set_exception(error)
            if self.stream is not None:
                self.done.exception()  # the stream's reader is told
        if self.stream is not None:
            self.stream.fail(error)

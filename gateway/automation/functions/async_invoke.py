"""Events for functions, delivered by the queue: called, tried again as Lambda does, and their end told.

That a function fails is tried again after 1 and 2 minutes, as often as its settings say; that it could not be called
(no room, a gateway that ends) costs no attempt, and is tried until the event is too old.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from gateway.automation.functions.async_put import function_of
from gateway.automation.functions.destinations import Ending, ending_puts
from gateway.automation.functions.directory import Directory
from gateway.automation.functions.errors import FunctionsOffError, UnknownFunctionError
from gateway.automation.functions.invoker import Invoked, Invoker, error_of
from gateway.domain.automation.delivery import Dead, Delivery, Done, Put, Result, Retry
from gateway.errors import GatewayError, StoreError
from metaros.automation.functions.errors import EngineClosedError, ThrottledError
from metaros.clock import Clock
from metaros.errors import MetarosError
from metaros.limits import LIMITS, Limits

__all__ = ["EventHandler"]

UNKNOWN_S = 900.0  # for a function that was not called yet
MARGIN_S = 30.0  # beside a function's own time: to start, and to be stored
MESSAGE_CHARS = 1000


class EventHandler:
    """The queue's handler of the kind `function`."""

    def __init__(
        self, invoker: Invoker, directory: Directory, *, clock: Clock, on: bool = True, limits: Limits = LIMITS
    ) -> None:
        """Not `on`: it takes none, and leaves them to other gateways of the store."""
        self._invoker = invoker
        self._directory = directory
        self._clock = clock
        self._on = on
        self._limits = limits
        self._under_way: dict[str, int] = {}  # by target
        self._timeouts: dict[str, float] = {}
        self._answers: dict[str, Invoked] = {}  # of deliveries at their end, until it is told

    def room(self, target: str | None = None) -> int:
        """Twice what runs at a time: the next call is at hand when one is over."""
        if not self._on:
            return 0
        if target is None:
            return self._limits.function_events_at_once - sum(self._under_way.values())
        return self._limits.function_events_each - self._under_way.get(target, 0)

    def timeout_s(self, target: str) -> float:
        """A function's own, as far as it is known, and what its start may take."""
        return self._timeouts.get(target, UNKNOWN_S) + self._limits.function_init_s + MARGIN_S

    async def deliver(self, delivery: Delivery) -> Result:
        """Call the function once."""
        target = delivery.put.target
        self._under_way[target] = self._under_way.get(target, 0) + 1
        try:
            return self._judge(delivery, await self._call(delivery))
        except UnknownFunctionError as error:
            return Dead("unknown_function", str(error))
        except ThrottledError as error:
            return Retry("throttled", str(error), counts=False)
        except FunctionsOffError as error:
            return Retry(error.code, str(error), counts=False)
        except EngineClosedError as error:
            return Retry("engine_closed", str(error), after_s=0.0, counts=False)
        except StoreError as error:
            return Retry("store_unavailable", str(error), counts=False)
        except MetarosError as error:
            return Retry(error.code, str(error)) if isinstance(error, GatewayError) else Dead(error.code, str(error))
        finally:
            self._under_way[target] -= 1
            if not self._under_way[target]:
                del self._under_way[target]

    def ended(self, delivery: Delivery, result: Done | Dead) -> Sequence[Put]:
        """Tell the destinations of the function's settings."""
        answer = self._answers.pop(delivery.id, None)
        name, qualifier = function_of(delivery.put.target)
        settings = self._directory.event_invoke(name, qualifier)
        if not (settings.on_success if isinstance(result, Done) else settings.on_failure or settings.dead_letter):
            return ()
        ending = Ending(delivery=delivery, result=result, answer=answer, at_ns=self._clock.wall_ns(), settings=settings)
        return ending_puts(ending, self._invoker.new_request_id)

    async def _call(self, delivery: Delivery) -> Invoked:
        put, context = delivery.put, dict[str, Any](delivery.put.context)
        name, qualifier = function_of(put.target)
        resolved = self._directory.resolve(name, qualifier)
        spec = await self._directory.spec(resolved.name, resolved.versions[0][0])
        self._timeouts[put.target] = spec.timeout_s
        return await self._invoker.invoke(
            name,
            qualifier,
            put.payload,
            kind="event",
            robot=put.robot,
            request_id=str(context.get("request") or delivery.id),
            client_context=str(context.get("client_context", "")),
            trace_id=str(context.get("trace", "")),
        )

    def _judge(self, delivery: Delivery, invoked: Invoked) -> Result:
        outcome = invoked.outcome
        if outcome.ok:
            self._answers[delivery.id] = invoked
            return Done()
        name, qualifier = function_of(delivery.put.target)
        settings = self._directory.event_invoke(name, qualifier)
        message = f"{outcome.error_type}: {error_of(outcome)}"[:MESSAGE_CHARS]
        tried, most = delivery.attempts + 1, delivery.put.policy.most_attempts
        if tried >= min(most, settings.most_retries + 1):
            self._answers[delivery.id] = invoked
        if settings.most_retries + 1 <= tried < most:  # the settings were others when it was accepted
            return Dead("function_error", message)
        return Retry("function_error", message)

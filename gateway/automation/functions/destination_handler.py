"""The queue's handler of the kind `destination`: what a function's end is told beyond the gateway's own functions."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping, Sequence
from typing import Any, Final, Protocol

import orjson

from gateway.domain.automation.delivery import Dead, Delivery, Done, Put, Result, Retry
from gateway.domain.automation.gateway_event import GatewayEvent
from gateway.errors import OverloadedError, RequestError, StoreError, TooManyRequestsError
from metaros.clock import Clock
from metaros.errors import MetarosError
from metaros.limits import LIMITS, Limits

__all__ = ["OWN_BUS", "RESULT_TYPE", "AwsSender", "DestinationHandler"]

OWN_BUS: Final = "arn:aws:events:local:000000000000:event-bus/default"
RESULT_TYPE: Final = "Lambda Function Invocation Result - "
LATER = (StoreError, OverloadedError, TooManyRequestsError)


class AwsSender(Protocol):
    """What is needed of the way to AWS."""

    async def send(self, arn: str, payload: bytes, facts: Mapping[str, Any]) -> str:
        """Give a record to a queue, topic, bus or function by its ARN; its id there. Raises MetarosError, OSError."""


class DestinationHandler:
    """Delivers records; the own bus takes them as events, which rules may match."""

    def __init__(
        self,
        aws: AwsSender,
        put_events: Callable[[Sequence[GatewayEvent]], Awaitable[object]],
        *,
        clock: Clock,
        limits: Limits = LIMITS,
    ) -> None:
        self._aws = aws
        self._put_events = put_events
        self._clock = clock
        self._limits = limits
        self._under_way = 0

    def room(self, target: str | None = None) -> int:
        """So many are under way at a time."""
        return self._limits.destinations_at_once - self._under_way

    def timeout_s(self, target: str) -> float:
        """For one record."""
        return self._limits.destination_s

    async def deliver(self, delivery: Delivery) -> Result:
        """Hand it over."""
        put = delivery.put
        self._under_way += 1
        try:
            if put.target == OWN_BUS:
                await self._put_events([self._gateway_event(delivery)])
                return Done()
            return Done(await self._aws.send(put.target, put.payload, {**put.context, "delivery": delivery.id}))
        except LATER as error:
            return Retry(error.code, str(error), counts=False)
        except RequestError as error:
            return Dead(error.code, str(error))
        except (MetarosError, OSError) as error:
            return Retry(getattr(error, "code", "unreachable"), str(error) or type(error).__name__)
        finally:
            self._under_way -= 1

    def ended(self, delivery: Delivery, result: Done | Dead) -> Sequence[Put]:
        """Nobody else is told."""
        return ()

    def _gateway_event(self, delivery: Delivery) -> GatewayEvent:
        put = delivery.put
        data = orjson.loads(put.payload)
        return GatewayEvent(
            id=delivery.id,
            type=f"{RESULT_TYPE}{put.context.get('side', '')}",
            source="lambda",
            at_ns=self._clock.wall_ns(),
            robot=put.robot,
            data=data if isinstance(data, dict) else {"payload": data},
        )

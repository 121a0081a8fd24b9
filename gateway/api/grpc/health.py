"""gRPC's health protocol: what `/readyz` says, for the probes that speak gRPC."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Collection
from typing import Any

from grpc_health.v1 import health_pb2

from gateway.api.grpc.authenticate import Call
from gateway.api.problem import NotFoundError
from metaros.limits import LIMITS

__all__ = ["HealthService"]

LOOK_S = 1.0


class HealthService:
    """Each of `names` is as well as the gateway is; "" is the gateway."""

    def __init__(self, names: Collection[str]) -> None:
        self._names = frozenset(["", *names])

    async def Check(self, request: health_pb2.HealthCheckRequest, call: Call) -> Any:
        """SERVING while `/readyz` says ok; NotFoundError for a service that is not here."""
        if request.service not in self._names:
            raise NotFoundError(f"there is no service {request.service[:100]}")
        return self._answer(request.service, call)

    async def List(self, _request: health_pb2.HealthListRequest, call: Call) -> Any:
        """All of them at once."""
        return health_pb2.HealthListResponse(statuses={name: self._answer(name, call) for name in self._names})

    async def Watch(self, request: health_pb2.HealthCheckRequest, call: Call) -> AsyncIterator[Any]:
        """Each change, for `LIMITS.health_watch_s` at most, as nobody has to say who watches; clients begin again."""
        clock, sent_status = call.services.clock, -1
        until_s = clock.monotonic_s() + LIMITS.health_watch_s
        while clock.monotonic_s() < until_s:
            answer = self._answer(request.service, call)
            if answer.status != sent_status:
                sent_status = answer.status
                yield answer
            await asyncio.sleep(LOOK_S)

    def _answer(self, service: str, call: Call) -> health_pb2.HealthCheckResponse:
        status = health_pb2.HealthCheckResponse.ServingStatus
        if service not in self._names:
            return health_pb2.HealthCheckResponse(status=status.SERVICE_UNKNOWN)
        well = all(state == "ok" for state in call.services.checks().values())
        return health_pb2.HealthCheckResponse(status=status.SERVING if well else status.NOT_SERVING)

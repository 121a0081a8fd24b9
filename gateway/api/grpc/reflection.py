"""gRPC's reflection: programs such as grpcurl learn the services from the gateway itself.

The package of the protocol's first name, v1alpha, is all that there is for Python; the messages of v1 are the same
ones, so the same bytes answer under both names.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Collection
from typing import Any

from grpc_reflection.v1alpha.reflection import ReflectionServicer

from gateway.api.grpc.authenticate import Call
from gateway.errors import RequestTimeoutError
from metaros.limits import LIMITS

__all__ = ["ReflectionService"]


class ReflectionService:
    """Answers for the services of these names."""

    def __init__(self, names: Collection[str]) -> None:
        self._answers = ReflectionServicer(names)

    async def ServerReflectionInfo(self, requests: AsyncIterator[Any], call: Call) -> AsyncIterator[Any]:
        """One answer a question; nobody has to say who asks, so a stream without a question ends after a body's time.

        Raises:
            RequestTimeoutError: nothing was asked for so long.
        """
        while True:
            question = await self._next(requests)
            if question is None:
                return
            for answer in self._answers.ServerReflectionInfo(iter([question]), None):
                yield answer

    async def _next(self, requests: AsyncIterator[Any]) -> Any:
        try:
            async with asyncio.timeout(LIMITS.body_s):
                return await anext(requests, None)
        except TimeoutError:
            raise RequestTimeoutError("nothing was asked for so long") from None

"""The document of the gateway itself, as OpenAPI describes it."""

from __future__ import annotations

from pydantic import Field

from gateway.api.models.base import Exact

__all__ = ["GatewayState"]


class GatewayState(Exact):
    """Which gateway this is, and its gRPC ports: where robots connect, and where programs do."""

    gateway: str = Field(examples=["4f1c6a0e2b7d4c55"])
    version: str = Field(examples=["2.0.0"])
    robots_port: int = Field(examples=[8081])
    programs_port: int = Field(examples=[8082])

"""What the operators' routes answer."""

from __future__ import annotations

from typing import Any

from pydantic import Field

from gateway.api.models.base import Model

__all__ = ["Debug", "Span", "Trace", "Traces"]


class Span(Model):
    """A stage, in nanoseconds of the gateway's wall clock since the epoch."""

    name: str = Field(examples=["link"], description="bus, tap, outbox, uplink, link, ingest, fanout, store")
    start_ns: int = Field(examples=[1789000000000000000])
    end_ns: int = Field(examples=[1789000000000850000])


class Trace(Model):
    """One followed sample; its stages touch, so their durations add up."""

    trace_id: str = Field(examples=["4bf92f3577b34da6a3ce929d0e0e4736"], description="as in W3C Trace Context")
    robot: str = Field(examples=["sim_1"])
    topic: str = Field(examples=["/sim_1/odom"])
    seq: int = Field(examples=[4711])
    batch_samples: int = Field(examples=[3], description="samples that came in the same batch")
    batch_bytes: int = Field(examples=[2160])
    start_ns: int = Field(examples=[1789000000000000000], description="the sample's stamp, on the gateway's clock")
    total_ns: int = Field(examples=[9300000], description="from there to the later of viewers and row")
    clock_offset_ns: int = Field(examples=[-120000], description="the gateway's clock less the robot's")
    clock_adjusted: bool = Field(examples=[False], description="whether a clock was so wrong that it had to yield")
    spans: list[Span]
    delivery: str = Field(alias="class", examples=["bulk"])


class Traces(Model):
    """The newest first."""

    traces: list[Trace]


class Debug(Model):
    """A report for people; its parts may change."""

    gateway: str = Field(examples=["8a1f0c"])
    store: str = Field(examples=["5e0d1b"])
    checks: dict[str, str] = Field(examples=[{"store": "ok"}])
    draining: bool = Field(examples=[False])
    process: dict[str, Any] = Field(examples=[{"pid": 4242, "python": "3.11.9"}])
    settings: dict[str, str] = Field(examples=[{"host": "127.0.0.1"}])
    numbers: dict[str, float] = Field(examples=[{"metaros_viewers": 2.0}])
    robots: dict[str, int] = Field(examples=[{"known": 5, "online": 3, "elsewhere": 1}])
    tasks: list[dict[str, Any]] = Field(
        examples=[[{"runs": "ConnectionLimits.run", "waits_at": "gateway/server/connections.py:1", "tasks": 1}]]
    )

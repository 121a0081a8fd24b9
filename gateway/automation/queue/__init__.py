"""The durable queue: what was accepted is delivered at least once, tried again in time, or kept as a dead letter."""

from __future__ import annotations

__all__: list[str] = []

"""The data of the time bar: how much is stored when, and what is lost."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from gateway.history.losses import Loss, loss_view, merged_losses
from gateway.store.telemetry.timeline import Density

__all__ = ["timeline_facts"]


def timeline_facts(density: Density, losses: Sequence[Loss], *, start_ns: int, end_ns: int) -> dict[str, Any]:
    """The answer: losses that would lie in one bucket of the bar are one."""
    return {
        "start_ms": start_ns / 1e6,
        "end_ms": end_ns / 1e6,
        "width_ms": density.width_ns / 1e6,
        "messages": density.messages,
        "rows": density.rows,
        "gaps": [loss_view(loss) for loss in merged_losses(losses, within_ns=density.width_ns)],
    }

"""What scenarios have in common: figures of a span, and the end: let all go out, end the gateway, compare."""

from __future__ import annotations

import asyncio
from typing import Any

from load_tests.fleet.figures import Histogram
from load_tests.fleet.load import IDLE, Load
from load_tests.fleet.run import Run
from load_tests.fleet.verify import verify

__all__ = ["conclude", "fresh", "gateway_figures", "goal", "interleave"]

SETTLE_S = 90.0


def goal(met: bool, text: str) -> dict[str, Any]:
    """A line of the report: met or missed."""
    return {"met": bool(met), "text": text}


def interleave(idle: int, active: int, load: Load) -> list[Load]:
    """Active robots evenly among idle ones, so that a ramp has both from its beginning."""
    total = idle + active
    loads = [IDLE] * total
    for index in range(active):
        loads[index * total // active] = load
    return loads


def fresh(run: Run) -> None:
    """Forget the latencies so far: what follows is another phase."""
    counts = run.simulator.counts
    counts.take_recent()
    counts.ack_s, counts.beat_s = Histogram(), Histogram()
    run.answers_s, run.late_s = Histogram(), Histogram()


def gateway_figures(run: Run, from_s: float, to_s: float) -> dict[str, Any]:
    """What the gateway took in a span of the run, and how quick it was."""
    cores, frames = run.mean("gateway_cores", from_s, to_s), run.mean("frames_per_s", from_s, to_s)
    counts = run.simulator.counts
    counts.take_recent()
    return {
        "span_s": [round(from_s, 2), round(to_s, 2)],
        "gateway_cores": cores,
        "gateway_cores_most": max(run.between("gateway_cores", from_s, to_s), default=0.0),
        "simulator_cores": run.mean("simulator_cores", from_s, to_s),
        "foreign_cores": run.mean("foreign_cores", from_s, to_s),
        "load_average": run.mean("load_average", from_s, to_s),
        "frames_per_s": frames,
        "gateway_us_per_frame": cores / frames * 1e6 if frames else 0.0,
        "sent_bytes_per_s": run.mean("sent_bytes_per_s", from_s, to_s),
        "received_bytes_per_s": run.mean("received_bytes_per_s", from_s, to_s),
        "gateway_rss_mib": max(run.between("gateway_rss", from_s, to_s), default=0.0) / 2**20,
        "gateway_fds": max(run.between("gateway_fds", from_s, to_s), default=0.0),
        "ack_ms": counts.ack_s.summary_ms(),
        "heartbeat_ms": counts.beat_s.summary_ms(),
        "http_ms": run.answers_s.summary_ms(),
        "simulator_late_ms": run.late_s.summary_ms(),
    }


async def conclude(run: Run, figures: dict[str, Any]) -> None:
    """No more load, until all that is held is acknowledged; then the store is compared with what was handed over."""
    counts = run.simulator.counts
    figures["settled"] = await run.simulator.settle(timeout_s=SETTLE_S)
    figures |= {
        "link_up_ms": counts.up_s.summary_ms(),
        "refusals": dict(counts.goodbyes),
        "put_off": dict(counts.put_off),
        "links_ended": dict(counts.downs),
        "rows": counts.rows,
        "samples": counts.samples,
    }
    await run.end()
    if run.setting.store_url:  # PostgreSQL: the check of stores looks at it
        figures["checked"] = "not here: metaros gateway store check"
        return
    verdict = await asyncio.to_thread(verify, run.gateway.data_dir / "gateway.sqlite", run.simulator.robots)
    figures |= {
        "accepted": verdict.accepted,
        "stored": verdict.stored,
        "declared_lost": verdict.declared,
        "lost": verdict.lost,
        "duplicated": verdict.duplicated,
        "not_acknowledged": verdict.waiting,
        "problems": [*run.faults, *verdict.problems[:20]],
    }

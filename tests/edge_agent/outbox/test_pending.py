"""How what was gathered becomes frames."""

from __future__ import annotations

from edge_agent.outbox.pending import FRAME_BYTES, Lost, Sample, runs
from metaros.limits import LIMITS, Limits


def sizes(queue: list[Sample | Lost], limits: Limits = LIMITS) -> list[int]:
    return [run.count if isinstance(run, Lost) else len(run) for run in runs(queue, limits)]


def test_frames_are_small_enough_for_live_samples_to_go_between_them() -> None:
    size = 1012  # with what a sample counts beside its bytes a KiB
    queue: list[Sample | Lost] = [(1, bytes(size)) for _ in range(300)]
    fit = FRAME_BYTES // (size + 12)
    assert sizes(queue) == [fit, fit, 300 - 2 * fit]
    assert sizes([*queue[:1], Lost(7, "full", 1, 1), (1, bytes(2 * FRAME_BYTES)), *queue[:2]]) == [1, 7, 1, 2]
    assert sizes(queue[:5], Limits(batch_bytes=2048)) == [2, 2, 1]

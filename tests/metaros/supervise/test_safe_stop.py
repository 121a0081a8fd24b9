"""The safe stop of a critical node: how it went is told as soon as it is known."""

from __future__ import annotations

import asyncio
from pathlib import Path

from metaros.supervise.safe_stop import SafeStops


async def test_its_end_is_a_change(tmp_path: Path) -> None:
    ended = asyncio.Event()
    stops = SafeStops(tmp_path, changed=ended.set)
    stops.ask("arm", ("sh", "-c", 'echo "$METAROS_NODE" > rest'), {})
    assert stops.outcome("arm") == "under way"
    await asyncio.wait_for(ended.wait(), 60)
    assert stops.outcome("arm") == "done"
    assert (tmp_path / "rest").read_text() == "arm\n"
    await stops.close()

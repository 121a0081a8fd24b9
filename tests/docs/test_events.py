"""The events that the gateway tells are those that the reference lists."""

from __future__ import annotations

import re
from pathlib import Path

from gateway.automation.events.kinds import EVENT_KINDS

REST = Path(__file__).parents[2] / "docs" / "reference" / "rest.md"


def test_every_kind_of_event_is_documented_with_its_data() -> None:
    rows = re.findall(r"^\| `metaros\.([a-z_.]+)` \| [^|]+ \| ([^|]*)\|$", REST.read_text(), re.MULTILINE)
    reported = {name: tuple(re.findall(r"`(\w+)`", data)) for name, data in rows}
    assert reported == {row.name: row.data for row in EVENT_KINDS}

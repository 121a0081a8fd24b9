"""The estimated cost of parsing a message type that an agent sends, known before a line of it is parsed."""

from __future__ import annotations

from typing import Final

from metaros._proto import link_pb2

__all__ = ["TYPE_STEPS", "parse_cost"]

TYPE_STEPS: Final = 64  # of each type: its hash, and the common messages that one line may bring along
PART_STEPS: Final = 2
ACTION_STEPS: Final = 8  # an action derives a dozen interfaces
STEP_BYTES: Final = 64  # of plain text
COUNTED: Final = "\n\r\v\f\x1c\x1d\x1e\x85\u2028\u2029,'\""  # what ends lines, and what long default values are made of


def parse_cost(text: link_pb2.TypeText, *, enough: int) -> int:
    """How many steps it takes: about one a line, 5 to 10 us each. Beyond `enough` it is not counted further."""
    steps = TYPE_STEPS + text.ByteSize() // STEP_BYTES
    for part in text.parts:
        if steps > enough:
            break
        steps += PART_STEPS if "/action/" not in part.name else ACTION_STEPS
        steps += sum(map(part.text.count, COUNTED))
    return steps

"""Gamepads that this machine's kernel knows, from /proc/bus/input/devices."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from metaros.drivers.probing import Found

__all__ = ["DEVICES", "find", "gamepads"]

DEVICES: Final = Path("/proc/bus/input/devices")
_NAME: Final = re.compile(r'^N: Name="(.*)"$', re.MULTILINE)
_HANDLERS: Final = re.compile(r"^H: Handlers=(.*)$", re.MULTILINE)


def find() -> Sequence[Found]:
    """Each gamepad."""
    return [
        Found(kind="joystick", summary=name, parameters={"device": path}, certain=True) for path, name in gamepads()
    ]


def gamepads(devices: Path = DEVICES) -> list[tuple[str, str]]:
    """File and name of each device that the kernel's joystick handler took, too."""
    try:
        text = devices.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return []
    found = []
    for block in text.split("\n\n"):
        name, handlers = _NAME.search(block), _HANDLERS.search(block)
        words = handlers[1].split() if handlers else []
        event = next((word for word in words if re.fullmatch(r"event\d+", word)), "")
        if event and any(re.fullmatch(r"js\d+", word) for word in words):
            found.append((f"/dev/input/{event}", name[1] if name else event))
    return found

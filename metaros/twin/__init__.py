"""What a robot is to be and what it is: the twin's document, checked, merged, compared. For agent and gateway."""

from __future__ import annotations

__all__: list[str] = []

"""What a robot is to be and what it is: the twin's document, checked, merged and compared. Shared by agent and gateway."""

from __future__ import annotations

__all__: list[str] = []

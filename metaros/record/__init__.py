"""Recordings: so far the replay of real robots' CARMEN logs."""

from __future__ import annotations

from metaros.record.replay import PlayReport, play_carmen

__all__ = ["PlayReport", "play_carmen"]

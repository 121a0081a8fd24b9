"""Recordings: the data logger, the player and readers of MCAP files, and the replay of real robots' CARMEN logs."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from metaros.record.bag import Bag, BagMessage, BagTopic, open_bag
from metaros.record.bag_output import BagOptions
from metaros.record.rewrite import Rewritten, rewrite

if TYPE_CHECKING:
    from metaros.record.export import export_csv, export_images, export_json
    from metaros.record.player import Player, PlayerReport
    from metaros.record.recorder import Recorder, RecordingReport, RingOptions
    from metaros.record.replay import PlayReport, play_carmen

__all__ = [
    "Bag",
    "BagMessage",
    "BagOptions",
    "BagTopic",
    "PlayReport",
    "Player",
    "PlayerReport",
    "Recorder",
    "RecordingReport",
    "Rewritten",
    "RingOptions",
    "export_csv",
    "export_images",
    "export_json",
    "open_bag",
    "play_carmen",
    "rewrite",
]

_EXPORTS = {  # loaded when used: an agent's black box needs none of them, and a restarted agent must be back soon
    "export": ("export_csv", "export_images", "export_json"),
    "player": ("Player", "PlayerReport"),
    "recorder": ("Recorder", "RecordingReport", "RingOptions"),
    "replay": ("PlayReport", "play_carmen"),
}
_MODULE_OF = {name: module for module, names in _EXPORTS.items() for name in names}


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"metaros.record.{_MODULE_OF[name]}"), name)

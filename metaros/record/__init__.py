"""Recordings: the data logger, the player and readers of MCAP files, and the replay of real robots' CARMEN logs."""

from __future__ import annotations

from metaros.record.bag import Bag, BagMessage, BagTopic, open_bag
from metaros.record.bag_output import BagOptions
from metaros.record.export import export_csv, export_images, export_json
from metaros.record.player import Player, PlayerReport
from metaros.record.recorder import Recorder, RecordingReport, RingOptions
from metaros.record.replay import PlayReport, play_carmen
from metaros.record.rewrite import Rewritten, rewrite

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

"""What a robot is to be and what it is: the twin's document, checked, merged, compared. For agent and gateway."""

from __future__ import annotations

from metaros.twin.canon import MAX_BYTES, MAX_DEPTH, canonical, digest, read
from metaros.twin.diff import ABSENT, Change, apply, diff
from metaros.twin.document import NodeWanted, TopicWanted, Twin, parse, parse_part
from metaros.twin.errors import TwinError
from metaros.twin.merge import merge, merge_all, patch_between, same
from metaros.twin.schema import json_schema
from metaros.twin.tables import KINDS_OF_NODE

__all__ = [
    "ABSENT",
    "KINDS_OF_NODE",
    "MAX_BYTES",
    "MAX_DEPTH",
    "Change",
    "NodeWanted",
    "TopicWanted",
    "Twin",
    "TwinError",
    "apply",
    "canonical",
    "diff",
    "digest",
    "json_schema",
    "merge",
    "merge_all",
    "parse",
    "parse_part",
    "patch_between",
    "read",
    "same",
]

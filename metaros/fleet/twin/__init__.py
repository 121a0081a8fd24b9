"""What a robot is to be and what it is: the twin's document, checked, merged, compared. For agent and gateway."""

from __future__ import annotations

from metaros.fleet.twin.canonical_json import MAX_BYTES, MAX_DEPTH, canonical, digest, read
from metaros.fleet.twin.diff import ABSENT, Change, apply, diff
from metaros.fleet.twin.document import NodeSpec, TopicSpec, Twin, parse, parse_part
from metaros.fleet.twin.errors import TwinError
from metaros.fleet.twin.merge import merge, merge_all, patch_between, same
from metaros.fleet.twin.schema import json_schema
from metaros.fleet.twin.tables import KINDS_OF_NODE

__all__ = [
    "ABSENT",
    "KINDS_OF_NODE",
    "MAX_BYTES",
    "MAX_DEPTH",
    "Change",
    "NodeSpec",
    "TopicSpec",
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

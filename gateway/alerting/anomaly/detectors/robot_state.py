"""One robot's part of all detectors: taken out of one evaluator, and put into another one under other numbers.

What is learned of a series, a topic or a robot depends on nothing else in the evaluator, but for the comparison with
robots like it, which goes on among the robots that the other evaluator has.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import xxhash
import zstandard

from gateway.alerting.anomaly.detectors.bank import SnapshotError
from gateway.alerting.anomaly.detectors.columns import Columns, Ints, Parts
from gateway.alerting.anomaly.detectors.detector_set import DetectorSet
from gateway.alerting.anomaly.detectors.lasting import FEATURES
from gateway.alerting.anomaly.registry import RobotNames
from metaros.limits import LIMITS

__all__ = ["VERSION", "pack_robot", "put_robot", "take_robot", "unpack_robot"]

VERSION = 1
NUMBERS = {  # what is a number of the evaluator's own: the one that it gave when the series was added stays
    "slot.slots": ("topic",),
    "slot.cells": ("robot",),
    "slot.novelties": ("bank",),
    "slot.cohorts": ("group",),
    "topic.topics": ("robot",),
    "robot.vectors": ("slots",),
}
_HEAD = struct.Struct("<HI")  # version, length of the words
_SUM_BYTES = 8


def take_robot(detectors: DetectorSet, known: RobotNames) -> dict[str, dict[str, npt.NDArray[Any]]]:
    """Everything that is learned of a robot, as groups of arrays in the order of its series and topics.

    Rows that wait for their second's end are left out, as the store has them; not so the rates of topics.
    """
    slots = _numbers(known.series)
    groups = {name: columns.take(rows) for name, (columns, rows) in _columns(detectors, known).items()}
    rates = np.flatnonzero(detectors.slots["is_rate"][slots]) if len(slots) else np.empty(0, np.int64)
    waiting = detectors.cells.take(slots[rates])
    groups["waiting"] = {**waiting, "at": rates[waiting["at"]]}
    groups["values"] = detectors.values.take(slots)
    bank = detectors.novelties.take(slots) if len(slots) else b""
    groups["bank"] = {"data": np.frombuffer(bank, np.uint8)}
    return groups


def put_robot(detectors: DetectorSet, known: RobotNames, groups: Parts) -> None:
    """Go on from what `take_robot` gave; the robot's series and topics were added in the same order.

    Raises:
        KeyError, ValueError, IndexError, SnapshotError: it is none of its, or does not fit; some of it was put then.
    """
    slots = _numbers(known.series)
    targets = _columns(detectors, known)
    if len(slots) and not np.array_equal(groups["slot.slots"]["place"], detectors.slots["place"][slots]):
        raise SnapshotError("the robot's series have other places in its vector")
    for name, (columns, rows) in targets.items():
        columns.put(rows, groups[name], keep=NUMBERS.get(name, ()))
    if len(slots):
        detectors.novelties.put(slots, groups["bank"]["data"].tobytes())
        detectors.values.put(slots, groups["values"])
        detectors.cells.put(slots, groups["waiting"])


def pack_robot(words: Mapping[str, Any], groups: Parts) -> bytes:
    """A robot's names and arrays as bytes: versioned, compressed, with a checksum."""
    arrays = [(group, name, array) for group, named in groups.items() for name, array in named.items()]
    shapes = [(group, name, array.dtype.str, array.shape) for group, name, array in arrays]
    head = json.dumps([words, shapes]).encode()
    plain = b"".join((_HEAD.pack(VERSION, len(head)), head, *(array.tobytes() for _, _, array in arrays)))
    body = zstandard.ZstdCompressor(level=1).compress(plain)
    return body + xxhash.xxh3_64_digest(body)


def unpack_robot(data: bytes) -> tuple[dict[str, Any], dict[str, dict[str, npt.NDArray[Any]]]]:
    """What `pack_robot` was given.

    Raises:
        SnapshotError: it is damaged, too large, or of another version.
    """
    body = data[:-_SUM_BYTES]
    if len(data) <= _SUM_BYTES or xxhash.xxh3_64_digest(body) != data[-_SUM_BYTES:]:
        raise SnapshotError("the robot's state is damaged: its checksum differs")
    try:
        if not 0 <= zstandard.frame_content_size(body) <= LIMITS.watch_state_plain_bytes:
            raise SnapshotError(f"the robot's state is larger than {LIMITS.watch_state_plain_bytes} bytes")
        plain = zstandard.ZstdDecompressor().decompress(body)
        version, length = _HEAD.unpack_from(plain)
        if version != VERSION:
            raise SnapshotError(f"the robot's state has version {version}, not {VERSION}")
        words, shapes = json.loads(plain[_HEAD.size : _HEAD.size + length])
        return words, _arrays(plain, _HEAD.size + length, shapes)
    except (zstandard.ZstdError, struct.error, TypeError, ValueError) as error:
        raise SnapshotError(f"the robot's state is damaged: {error!r}") from None


def _arrays(plain: bytes, start: int, shapes: Sequence[Any]) -> dict[str, dict[str, npt.NDArray[Any]]]:
    groups: dict[str, dict[str, npt.NDArray[Any]]] = {}
    for group, name, kind, shape in shapes:
        dtype, count = np.dtype(kind), int(np.prod(shape, dtype=np.int64))
        groups.setdefault(group, {})[name] = np.frombuffer(plain, dtype, count, start).reshape(shape)
        start += count * dtype.itemsize
    return groups


def _columns(detectors: DetectorSet, known: RobotNames) -> dict[str, tuple[Columns, Ints]]:
    """All columns, and which rows of them are the robot's."""
    slots, topics = _numbers(known.series), _numbers(known.topics)
    by_slot = {
        "slots": detectors.slots,
        "cells": detectors.cells.slots,
        "flat": detectors.flat.columns,
        "novelties": detectors.novelties.columns,
        "cohorts": detectors.cohorts.columns,
        "lasting": detectors.lasting.columns,
        **{
            f"lasting.{one.name}": ranges.columns
            for one, ranges in zip(FEATURES, detectors.lasting.ranges, strict=True)
        },
        **{f"rates.{name}": columns for name, columns in detectors.rates.parts.items()},
    }
    by_robot = {
        "cells": detectors.cells.robots,
        "presence": detectors.presence.robots,
        "vectors": detectors.vectors.columns,
    }
    robot = np.array([known.number] if len(slots) else [], np.int64)
    return {
        **{f"slot.{name}": (columns, slots) for name, columns in by_slot.items()},
        **{f"topic.{name}": (columns, topics) for name, columns in detectors.presence.parts.items()},
        **{f"robot.{name}": (columns, robot) for name, columns in by_robot.items()},
    }


def _numbers(named: Mapping[str, int]) -> Ints:
    return np.array(list(named.values()), np.int64)

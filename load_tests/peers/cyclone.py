"""cyclonedds-python: one struct with a `str`, its fastest field; reliable, keep-all, taken in the reader's listener."""

import functools
import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

__all__ = ["receiver", "sender"]

_CONFIG = (
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name='lo'/></Interfaces>"
    "<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
    "<Peers><Peer address='127.0.0.1'/></Peers></Discovery></Domain></CycloneDDS>"
)
os.environ.setdefault("CYCLONEDDS_URI", _CONFIG)  # read when the first participant is made

from cyclonedds.core import Listener, Policy, Qos  # noqa: E402
from cyclonedds.domain import DomainParticipant  # noqa: E402
from cyclonedds.idl import IdlStruct  # noqa: E402
from cyclonedds.pub import DataWriter  # noqa: E402
from cyclonedds.sub import DataReader  # noqa: E402
from cyclonedds.topic import Topic  # noqa: E402
from cyclonedds.util import duration  # noqa: E402

_QOS = Qos(Policy.Reliability.Reliable(duration(seconds=20)), Policy.History.KeepAll)
_AT_ONCE = 256
_KEPT: list[object] = []


@dataclass
class Text(IdlStruct, typename="bench.Text"):
    """What is sent."""

    data: str


@functools.cache
def _participant() -> DomainParticipant:
    return DomainParticipant(0)


def _topic(name: str) -> Topic[Text]:
    return Topic(_participant(), name, Text, qos=_QOS)


def sender(job: dict[str, Any], topic: str) -> Callable[[], object]:
    """`write` of a reliable writer."""
    writer = DataWriter(_participant(), _topic(topic), qos=_QOS)
    return functools.partial(writer.write, Text(data="x" * job["size"]))


def receiver(job: dict[str, Any], topic: str, callback: Callable[[], object]) -> None:
    """Every sample that is there, decoded, whenever the listener is told of data."""

    class Taker(Listener):
        def on_data_available(self, reader: DataReader[Text]) -> None:
            for _ in reader.take(_AT_ONCE):
                callback()

    _KEPT.append(DataReader(_participant(), _topic(topic), qos=_QOS, listener=Taker()))

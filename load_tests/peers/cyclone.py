"""cyclonedds-python: one struct with a `str`, its fastest field; reliable, keep-all, taken by a thread.

On the loopback alone, with datagrams as large as UDP's: large samples are faster so than by its defaults.
"""

import functools
import os
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

__all__ = ["receiver", "sender"]

_CONFIG = (
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name='lo'/></Interfaces>"
    "<AllowMulticast>false</AllowMulticast><MaxMessageSize>65500B</MaxMessageSize><FragmentSize>65000B</FragmentSize>"
    "</General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
    "<Peers><Peer address='127.0.0.1'/></Peers></Discovery></Domain></CycloneDDS>"
)
os.environ.setdefault("CYCLONEDDS_URI", _CONFIG)  # read when the first participant is made

from cyclonedds.core import InstanceState, Policy, Qos, ReadCondition, SampleState, ViewState, WaitSet  # noqa: E402
from cyclonedds.domain import DomainParticipant  # noqa: E402
from cyclonedds.idl import IdlStruct  # noqa: E402
from cyclonedds.pub import DataWriter  # noqa: E402
from cyclonedds.sub import DataReader  # noqa: E402
from cyclonedds.topic import Topic  # noqa: E402
from cyclonedds.util import duration  # noqa: E402

_QOS = Qos(Policy.Reliability.Reliable(duration(seconds=20)), Policy.History.KeepAll)
_AT_ONCE = 256
_PATIENCE = duration(milliseconds=100)  # a reader that came later waits no longer


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


@functools.cache
def _readers() -> tuple[WaitSet, list[tuple[DataReader[Text], Callable[[], object]]]]:
    """One thread for all readers: a listener must not write what waits for acknowledgements."""
    waiting, readers = WaitSet(_participant()), []

    def run() -> None:
        while True:
            waiting.wait(_PATIENCE)
            for reader, callback in readers:
                while batch := reader.take(_AT_ONCE):
                    for _ in batch:
                        callback()

    threading.Thread(target=run, daemon=True).start()
    return waiting, readers


def receiver(job: dict[str, Any], topic: str, callback: Callable[[], object]) -> None:
    """Everything that is there, decoded, whenever the wait set is told of data."""
    waiting, readers = _readers()
    reader = DataReader(_participant(), _topic(topic), qos=_QOS)
    readers.append((reader, callback))
    waiting.attach(ReadCondition(reader, ViewState.Any | InstanceState.Any | SampleState.NotRead))

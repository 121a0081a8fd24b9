"""Quality of service, to DDS and back. Deadlines, leases and lifespans stay on their own side of the bridge."""

from __future__ import annotations

from cyclonedds.core import Policy, Qos

from metaros.wire import Durability, History, QoSProfile, Reliability

__all__ = ["from_dds", "reader_qos", "writer_qos"]

_BLOCK_NS = 100_000_000  # a full writer waits so long for a slow reliable reader, then the sample is counted as lost
_XCDR1 = Policy.DataRepresentation(use_cdrv0_representation=True)  # what ROS 2 sends on DDS and on Zenoh alike
_LENIENT = Policy.TypeConsistency.AllowTypeCoercion(
    ignore_sequence_bounds=True,
    ignore_string_bounds=True,
    ignore_member_names=True,
    prevent_type_widening=False,
    force_type_validation=False,
)


def from_dds(qos: Qos) -> QoSProfile:
    """What an endpoint on DDS offers or asks for. DDS does not tell others its depth."""
    reliable = isinstance(qos[Policy.Reliability], Policy.Reliability.Reliable)
    kept = qos[Policy.Durability] not in (None, Policy.Durability.Volatile)
    return QoSProfile(
        reliability=Reliability.RELIABLE if reliable else Reliability.BEST_EFFORT,
        durability=Durability.TRANSIENT_LOCAL if kept else Durability.VOLATILE,
        history=History.KEEP_LAST,
    )


def reader_qos(qos: QoSProfile) -> Qos:
    """For a reader of ours; it never hears the bridge's own writers."""
    return Qos(*_common(qos), _LENIENT, Policy.IgnoreLocal.Participant)


def writer_qos(qos: QoSProfile, *, type_hash: str = "") -> Qos:
    """For a writer of ours; the hash is where rmw implementations look for it."""
    told = [Policy.Userdata(f"typehash={type_hash};".encode())] if type_hash else []
    return Qos(*_common(qos), *told)


def _common(qos: QoSProfile) -> list[Policy]:
    reliable = Policy.Reliability.Reliable(_BLOCK_NS)
    return [
        reliable if qos.reliability is Reliability.RELIABLE else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal
        if qos.durability is Durability.TRANSIENT_LOCAL
        else Policy.Durability.Volatile,
        Policy.History.KeepLast(max(1, qos.depth)),
        _XCDR1,
    ]

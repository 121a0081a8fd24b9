"""DDS on this machine's loopback alone, in a domain that no other test sees."""

from __future__ import annotations

import os

__all__ = ["dds_config", "dds_domain"]

_CONFIG = """<CycloneDDS><Domain>
  <General><Interfaces><NetworkInterface name="lo"/></Interfaces><AllowMulticast>false</AllowMulticast></General>
  <Discovery><Tag>{tag}</Tag><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>99</MaxAutoParticipantIndex>
    <Peers><Peer address="127.0.0.1"/></Peers></Discovery>
</Domain></CycloneDDS>"""


def dds_domain() -> int:
    """Of this process. Those above 100 would take ports that others are given."""
    return 10 + os.getpid() % 90


def dds_config() -> str:
    """For `Domain`, or as CYCLONEDDS_URI for a program: the tag keeps apart who happens to have the same domain."""
    return _CONFIG.format(tag=f"metaros_{os.getpid()}")

"""Data keys of topics and services: `<domain>/<name>/<dds type>/<type hash>`."""

from __future__ import annotations

from dataclasses import dataclass

from metaros.errors import NameError_
from metaros.limits import LIMITS
from metaros.wire.names import check_fqn, check_hash, dds_name, ros_name

__all__ = ["DataKey", "parse_key"]

MAX_DOMAIN = 232  # ROS's own limit, so that the same number also works over DDS


@dataclass(frozen=True, slots=True)
class DataKey:
    """One topic or service with its type, in one domain. `topic` has its leading slash."""

    domain: int
    topic: str
    type_name: str
    type_hash: str

    def __str__(self) -> str:
        """The key expression, checked part by part; NameError_ names the part that is wrong."""
        if not 0 <= self.domain <= MAX_DOMAIN:
            raise NameError_(f"domain {self.domain} is not within 0..{MAX_DOMAIN}")
        key = f"{self.domain}/{check_fqn(self.topic)}/{dds_name(self.type_name)}/{check_hash(self.type_hash)}"
        if len(key) > LIMITS.key_chars:
            raise NameError_(f"key of {len(key)} characters is longer than the limit of {LIMITS.key_chars}: {key}")
        return key

    def any_hash(self) -> str:
        """The key expression that matches this topic and type whatever the hash (Humble writes none)."""
        return str(self).rpartition("/")[0] + "/*"


def parse_key(key: str) -> DataKey:
    """Read a data key; NameError_ for anything else, such as a foreign Zenoh key."""
    if len(key) > LIMITS.key_chars:
        raise NameError_(f"key of {len(key)} characters is longer than the limit of {LIMITS.key_chars}")
    parts = key.split("/")
    if len(parts) < 4:
        raise NameError_(f"{key!r} is no data key: <domain>/<name>/<type>/<hash>")
    domain = parse_domain(parts[0])
    topic = "/" + check_fqn("/".join(parts[1:-2]))
    return DataKey(domain, topic, ros_name(parts[-2]), check_hash(parts[-1]))


def parse_domain(text: str) -> int:
    """A domain id written without sign or leading zeros."""
    if not (text.isascii() and text.isdigit() and len(text) <= 3) or str(int(text)) != text or int(text) > MAX_DOMAIN:
        raise NameError_(f"{text!r} is no domain id within 0..{MAX_DOMAIN}")
    return int(text)

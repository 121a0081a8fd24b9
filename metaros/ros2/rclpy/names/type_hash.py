"""`rclpy.type_hash`: the hash of an interface's definition."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Final, TypedDict

__all__ = ["TypeHash", "TypeHashDictionary"]

HASH_BYTES: Final = 32
_TEXT: Final = re.compile(r"RIHS([0-9]{2})_([0-9a-f]{64})")


class TypeHashDictionary(TypedDict):
    """The arguments of `TypeHash`."""

    version: int
    value: bytes


class TypeHash:
    """A version of the hashing rule, and the 32 bytes; version -1 where there is no hash."""

    __slots__ = ("_value", "_version")

    def __init__(self, version: int = -1, value: bytes | Iterable[int] = bytes(HASH_BYTES)) -> None:
        self.version = version
        self.value = bytes(value)

    @classmethod
    def from_text(cls, text: str) -> TypeHash:
        """Of `RIHS01_…`; the invalid hash of anything else, such as Humble's "TypeHashNotSupported"."""
        match = _TEXT.fullmatch(text)
        return cls() if match is None else cls(int(match[1]), bytes.fromhex(match[2]))

    @property
    def version(self) -> int:
        """The rule's version, 1 for RIHS01."""
        return self._version

    @version.setter
    def version(self, value: int) -> None:
        if not isinstance(value, int):
            raise AssertionError(f"the version of a type hash is a number, not {value!r}")
        self._version = value

    @property
    def value(self) -> bytes:
        """The bytes."""
        return self._value

    @value.setter
    def value(self, value: bytes) -> None:
        if not isinstance(value, bytes):
            raise AssertionError(f"the value of a type hash is bytes, not {value!r}")
        self._value = value

    def __eq__(self, other: object) -> bool:
        return isinstance(other, TypeHash) and (self._version, self._value) == (other._version, other._value)

    __hash__ = None  # type: ignore[assignment]  # as in rclpy: its fields can be set

    def __str__(self) -> str:
        if self._version <= 0 or len(self._value) != HASH_BYTES:
            return "INVALID"
        return f"RIHS{self._version:02d}_{self._value.hex()}"

    def __repr__(self) -> str:
        return f"TypeHash(version={self._version}, value={self._value!r})"

"""A disk in memory for the outbox: it can be full, fail, and crash in the middle of a write."""

from __future__ import annotations

from random import Random  # noqa: TID251 - the type of an argument

from edge_agent.errors import DiskError, DiskFullError

__all__ = ["Crash", "SimDisk"]


class Crash(BaseException):
    """The machine stops here; nothing of the program runs any more."""


class SimDisk:
    """What is synced stays; a crash inside a write leaves any part of it. `fail_at` counts writing calls down."""

    def __init__(self, rng: Random, *, size_bytes: int = 1 << 40) -> None:
        self.files: dict[str, bytes] = {}
        self.size_bytes = size_bytes
        self.crash_in: int | None = None
        self.fail_in: int | None = None
        self.foreign_bytes = 0  # what others have filled
        self._rng = rng

    @property
    def used_bytes(self) -> int:
        return sum(map(len, self.files.values())) + self.foreign_bytes

    def names(self, folder: str) -> list[str]:
        return sorted(name for name in self.files if name.startswith(f"{folder}/"))

    def size(self, name: str) -> int:
        return len(self.files.get(name, b""))

    def read(self, name: str, offset: int, size: int) -> bytes:
        return self.files[name][offset : offset + size]

    def append(self, name: str, offset: int, data: bytes) -> None:
        before = self.files.get(name, b"")[:offset]
        if self._stops():
            if self._rng.random() < 0.8:
                kept = self._rng.randrange(len(data) + 1)
                self.files[name] = before + data[:kept]
            raise Crash
        self._must_work(len(data) - (self.size(name) - offset))
        self.files[name] = before + data

    def replace(self, name: str, data: bytes) -> None:
        if self._stops():
            if self._rng.random() < 0.5:
                self.files[name] = data
            raise Crash
        self._must_work(len(data))
        self.files[name] = data

    def remove(self, name: str) -> None:
        if self._stops():
            if self._rng.random() < 0.5:
                self.files.pop(name, None)
            raise Crash
        self.files.pop(name, None)

    def free(self) -> tuple[int, int]:
        return max(0, self.size_bytes - self.used_bytes), self.size_bytes

    def reserve(self, name: str, size: int) -> None:
        if size:
            self._must_work(size - self.size(name))
            self.files[name] = bytes(size)
        else:
            self.files.pop(name, None)

    def repair(self) -> None:
        """There is space again, and nothing fails."""
        self.foreign_bytes, self.size_bytes, self.fail_in, self.crash_in = 0, 1 << 40, None, None

    def copy(self) -> SimDisk:
        """Another disk with the same files."""
        disk = SimDisk(self._rng, size_bytes=self.size_bytes)
        disk.files = dict(self.files)
        return disk

    def rot(self) -> str:
        """One bit of one file turns over; its name."""
        names = [name for name in sorted(self.files) if self.files[name] and name != "reserve"]
        if not any(name.endswith(".seg") for name in names):
            return ""
        name = self._rng.choice(names)
        data, at = bytearray(self.files[name]), self._rng.randrange(len(self.files[name]))
        data[at] ^= 1 << self._rng.randrange(8)
        self.files[name] = bytes(data)
        return name

    def _stops(self) -> bool:
        if self.crash_in is None:
            return False
        self.crash_in -= 1
        return self.crash_in < 0

    def _must_work(self, more: int) -> None:
        if self.fail_in is not None:
            self.fail_in -= 1
            if self.fail_in < 0:
                self.fail_in = None
                raise DiskError("an I/O error")
        if more > self.size_bytes - self.used_bytes:
            raise DiskFullError("no space left")

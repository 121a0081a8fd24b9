"""The file of keys: private, whole, and with the keys before the present one."""

from __future__ import annotations

import json
import stat
import sys
from pathlib import Path

import pytest

from metaros.clock import ManualClock
from metaros.errors import KeyringError
from metaros.limits import LIMITS
from metaros.seal import Keyring, SealKey

CLOCK = ManualClock()


def ring_of(count: int) -> Keyring:
    """That many keys."""
    return Keyring(tuple(SealKey.make(CLOCK) for _ in range(count)))


def test_a_file_comes_back_as_it_was_and_is_its_owners_alone(tmp_path: Path) -> None:
    path, ring = tmp_path / "deep" / "seal.keys", ring_of(3)
    ring.save(path)
    assert Keyring.load(path) == ring
    assert stat.S_IMODE(path.stat().st_mode) == 0o600 or sys.platform == "win32"
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.skipif(sys.platform == "win32", reason="no modes there")
@pytest.mark.parametrize("mode", [0o640, 0o604, 0o660])
def test_a_file_that_others_can_read_is_refused_with_the_way_out(tmp_path: Path, mode: int) -> None:
    path = tmp_path / "seal.keys"
    ring_of(1).save(path)
    path.chmod(mode)
    with pytest.raises(KeyringError, match=f"chmod 600 {path}"):
        Keyring.load(path)


def test_a_new_file_does_not_take_the_place_of_one_that_is_there(tmp_path: Path) -> None:
    path, ring = tmp_path / "seal.keys", ring_of(1)
    ring.save(path, new=True)
    with pytest.raises(KeyringError, match="is there already"):
        ring_of(1).save(path, new=True)
    assert Keyring.load(path) == ring
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{}",
        '{"keys": 5}',
        '{"keys": []}',
        '{"keys": [{"id": "00", "secret": "", "created_ns": 0}]}',
        '{"keys": [{"id": "zz", "secret": "AA==", "created_ns": 0}]}',
        '{"keys": [{"id": "0011223344556677", "secret": "!", "created_ns": 0}]}',
        "[" * 60_000,
    ],
)
def test_a_damaged_file_is_named(tmp_path: Path, text: str) -> None:
    path = tmp_path / "seal.keys"
    path.write_text(text)
    path.chmod(0o600)
    with pytest.raises(KeyringError, match=r"seal\.keys"):
        Keyring.load(path)


def test_a_missing_file_is_said_with_how_to_make_one(tmp_path: Path) -> None:
    with pytest.raises(KeyringError, match="metaros seal key new"):
        Keyring.load(tmp_path / "none")


def test_the_same_key_twice_is_refused(tmp_path: Path) -> None:
    path, ring = tmp_path / "seal.keys", ring_of(1)
    Keyring((*ring.keys, *ring.keys)).save(path)
    with pytest.raises(KeyringError, match="twice"):
        Keyring.load(path)


def test_rotation_keeps_the_keys_before_up_to_their_limit() -> None:
    ring = ring_of(1)
    for _ in range(LIMITS.seal_keys_kept + 3):
        before, ring = ring, ring.rotated(SealKey.make(CLOCK))
        assert ring.current not in before.keys
        assert ring.keys[-2] == before.current
    assert len(ring.keys) == LIMITS.seal_keys_kept + 1
    assert ring.rotated(SealKey.make(CLOCK), keep=0).find(ring.current.key_id) is None
    assert [key.key_id for key in ring.rotated(SealKey.make(CLOCK), keep=2).keys[:2]] == [
        k.key_id for k in ring.keys[-2:]
    ]


def test_a_secret_is_in_no_representation(tmp_path: Path) -> None:
    path, ring = tmp_path / "seal.keys", ring_of(1)
    ring.save(path)
    secret = json.loads(path.read_text())["keys"][0]["secret"]
    assert secret not in repr(ring)
    assert repr(ring.current.secret) not in repr(ring)

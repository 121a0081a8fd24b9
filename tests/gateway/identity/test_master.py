"""The master key: one a data directory, its owner's alone, and every sealed secret bound to what it is."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from gateway.errors import DamagedError
from gateway.identity.master import MASTER_KEY, MasterKey, make_key_file
from metaros.errors import ConfigError

PLAIN = b"a secret that must not be seen"


def test_what_was_sealed_is_opened_by_the_next_start(tmp_path: Path) -> None:
    sealed = MasterKey.load_or_make(tmp_path).seal("api-key", "k1", PLAIN)
    assert PLAIN not in sealed
    assert MasterKey.load_or_make(tmp_path).open("api-key", "k1", sealed) == PLAIN


def test_the_file_is_its_owner_s_alone(tmp_path: Path) -> None:
    MasterKey.load_or_make(tmp_path)
    path = tmp_path / MASTER_KEY
    assert len(path.read_bytes()) == 32
    assert [item.name for item in tmp_path.iterdir()] == [MASTER_KEY]
    if os.name == "posix":
        assert path.stat().st_mode & 0o777 == 0o600
        path.chmod(0o640)
        with pytest.raises(ConfigError, match="chmod 600"):
            MasterKey.load_or_make(tmp_path)


def test_the_same_secret_never_looks_the_same_twice(tmp_path: Path) -> None:
    key = MasterKey.load_or_make(tmp_path)
    assert len({key.seal("p", "1", PLAIN) for _ in range(100)}) == 100


@pytest.mark.parametrize(("purpose", "secret_id"), [("ca", "k1"), ("api-key", "k2"), ("", "k1")])
def test_no_secret_passes_for_another(tmp_path: Path, purpose: str, secret_id: str) -> None:
    key = MasterKey.load_or_make(tmp_path)
    with pytest.raises(DamagedError):
        key.open(purpose, secret_id, key.seal("api-key", "k1", PLAIN))


def test_another_key_a_cut_and_every_flipped_bit_are_refused(tmp_path: Path) -> None:
    key = MasterKey.load_or_make(tmp_path)
    sealed = key.seal("api-key", "k1", PLAIN)
    with pytest.raises(DamagedError):
        MasterKey(b"x" * 32).open("api-key", "k1", sealed)
    damaged = [sealed[:size] for size in range(len(sealed))]
    damaged += [
        bytes([*sealed[:n], sealed[n] ^ (1 << bit), *sealed[n + 1 :]]) for n in range(len(sealed)) for bit in range(8)
    ]
    for text in damaged:
        with pytest.raises(DamagedError):
            key.open("api-key", "k1", text)


def test_of_many_who_make_it_at_once_all_have_the_same(tmp_path: Path) -> None:
    with ThreadPoolExecutor(8) as pool:
        keys = list(pool.map(lambda _: MasterKey.load_or_make(tmp_path), range(32)))
    sealed = keys[0].seal("p", "1", PLAIN)
    assert {key.open("p", "1", sealed) for key in keys} == {PLAIN}


@pytest.mark.parametrize("content", [b"", b"short", b"x" * 33])
def test_what_is_no_key(tmp_path: Path, content: bytes) -> None:
    (tmp_path / MASTER_KEY).write_bytes(content)
    (tmp_path / MASTER_KEY).chmod(0o600)
    with pytest.raises(ConfigError, match="no master key"):
        MasterKey.load_or_make(tmp_path)


def test_gateways_share_the_key_in_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shared = tmp_path / "secret" / "fleet.key"
    one = MasterKey.load_or_make(tmp_path / "one", shared)
    monkeypatch.setenv("METAROS_MASTER_KEY", str(shared))
    two = MasterKey.load_or_make(tmp_path / "two")
    assert two.open("api-key", "k1", one.seal("api-key", "k1", PLAIN)) == PLAIN
    assert [item.name for item in tmp_path.iterdir()] == ["secret"], "no data directory has one of its own"


def test_a_sub_key_is_of_its_purpose_alone(tmp_path: Path) -> None:
    key = MasterKey.load_or_make(tmp_path)
    (one,), (other,) = key.subkeys("one"), key.subkeys("other")
    assert len({one, other, (tmp_path / MASTER_KEY).read_bytes()}) == 3
    assert key.subkeys("one") == (one,)
    make_key_file(tmp_path / "master.key.next")
    assert key.subkeys("one")[0] == one
    assert len(key.subkeys("one")) == 2

"""Interfaces from folders of files, of the program's own and of a ROS 2 installation."""

from __future__ import annotations

import logging
import os
from pathlib import Path

import pytest

from metaros.cdr import codec
from metaros.errors import UnknownTypeError
from metaros.idl import Catalogue, message_class, type_hash
from metaros.idl.catalogue import _ShippedCatalogue, default_catalogue
from metaros.idl.folders import interface_file
from metaros.limits import LIMITS


def write(folder: Path, files: dict[str, str | bytes]) -> Path:
    for name, text in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return folder


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("METAROS_INTERFACE_PATH", str(tmp_path / "own"))
    return tmp_path / "own"


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{tmp_path / 'nowhere'}{os.pathsep}{tmp_path / 'ros'}")
    return tmp_path / "ros" / "share"


def fresh() -> Catalogue:
    return _ShippedCatalogue()


def test_types_of_own_folders_work_like_shipped_ones(own: Path) -> None:
    write(
        own,
        {
            "my_msgs/msg/Battery.msg": "std_msgs/Header header\nfloat32 volts 12.5\nCell[] cells\n",
            "my_msgs/msg/Cell.msg": "uint8 number",
            "my_msgs/srv/Charge.srv": "Battery battery\n---\nbool done",
            "my_msgs/action/Drive.action": "float32 metres\n---\nfloat32 driven\n---\nCell cell",
            "my_msgs/msg/notes.txt": "no interface",
            "my_msgs/msg/Battery.idl": "module my_msgs {}",
        },
    )
    catalogue = fresh()
    battery = message_class("my_msgs/msg/Battery", catalogue)
    assert codec(battery).decode(codec(battery).encode(battery(volts=3.0))).volts == 3.0
    assert message_class("my_msgs/srv/Charge_Request", catalogue)().battery == battery()
    assert message_class("my_msgs/action/Drive", catalogue).Goal().metres == 0.0
    wanted = ["my_msgs/action/Drive", "my_msgs/msg/Battery", "my_msgs/msg/Cell", "my_msgs/srv/Charge"]
    assert catalogue.names_of("my_msgs") == wanted
    assert set(wanted) < set(catalogue.names())
    assert fresh().names_of("my_msgs") == wanted
    assert interface_file("my_msgs/msg/Cell") == own / "my_msgs/msg/Cell.msg"
    by_hand = Catalogue()
    by_hand.add_all([catalogue.get("my_msgs/msg/Cell")])
    assert type_hash("my_msgs/msg/Cell", catalogue) == type_hash("my_msgs/msg/Cell", by_hand)


def test_a_package_or_an_installation_may_be_named_itself(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(own, {"first/my_msgs/msg/A.msg": "int8 a", "prefix/share/my_msgs/msg/B.msg": "int8 b"})
    write(own, {"other/my_msgs/msg/A.msg": "int16 other"})
    folders = ["first/my_msgs", "prefix", "other"]
    monkeypatch.setenv("METAROS_INTERFACE_PATH", os.pathsep.join(str(own / name) for name in folders))
    catalogue = fresh()
    assert catalogue.message("my_msgs/msg/A").fields[0].type.base == "int8"
    assert "my_msgs/msg/B" in catalogue
    assert "my_msgs/msg/B" in fresh().names()


def test_an_installation_adds_what_is_not_shipped(installed: Path, caplog: pytest.LogCaptureFixture) -> None:
    write(
        installed,
        {
            "nav2_msgs/action/Spin.action": "float32 angle\n---\n---\n",
            "std_msgs/msg/String.msg": "int32 other",
            "std_msgs/msg/Extra.msg": "String text",
            "odd_pkg/msg/Only.idl": "module odd_pkg {}",
        },
    )
    catalogue = fresh()
    assert catalogue.message("std_msgs/msg/String") == default_catalogue().message("std_msgs/msg/String")
    assert message_class("std_msgs/msg/Extra", catalogue)().text.data == ""
    assert message_class("nav2_msgs/action/Spin", catalogue).Goal().angle == 0.0
    assert "nav2_msgs/action/Spin" in fresh().names()
    assert not any(name.startswith("odd_pkg") for name in catalogue.names())
    assert caplog.records == []


def test_own_definitions_win_over_shipped_ones_and_it_is_said(own: Path, caplog: pytest.LogCaptureFixture) -> None:
    files = {"std_msgs/msg/String.msg": "string data\nint32 more", "std_msgs/msg/Bool.msg": "bool data"}
    write(own, {**files, "builtin_interfaces/msg/Time.msg": "float64 seconds"})
    catalogue = fresh()
    with caplog.at_level(logging.WARNING, "metaros.idl"):
        assert len(catalogue.message("std_msgs/msg/String").fields) == 2
        assert len(catalogue.message("std_msgs/msg/Bool").fields) == 1
        assert [field.name for field in catalogue.message("builtin_interfaces/msg/Time").fields] == ["sec", "nanosec"]
    texts = [record.getMessage() for record in caplog.records]
    assert "String.msg is used for std_msgs/msg/String; it differs from the shipped one" in texts[0]
    assert "Time.msg is not used: it differs" in texts[1]
    assert len(texts) == 2


def test_bad_files_are_named_and_leave_others_alone(own: Path, caplog: pytest.LogCaptureFixture) -> None:
    write(
        own,
        {
            "my_msgs/msg/Bad.msg": "int32 a\nwhat is this",
            "my_msgs/msg/Bytes.msg": b"\xff\xfe",
            "my_msgs/msg/Large.msg": "# x\n" * 1_000_001,
            "my_msgs/srv/Bad.srv": "int32 a",
            "my_msgs/msg/Good.msg": "int32 a",
            "my_msgs/msg/Lost.msg": "Nothing a",
            "std_msgs/msg/String.msg": "nonsense",
        },
    )
    (own / "my_msgs/msg/Gone.msg").symlink_to(own / "nowhere")
    catalogue = fresh()
    said = {
        "my_msgs/msg/Bad": "Bad.msg: my_msgs/msg/Bad, line 2",
        "my_msgs/msg/Bytes": "Bytes.msg: the text is not UTF-8",
        "my_msgs/msg/Large": "Large.msg: more than 1000000 characters",
        "my_msgs/msg/Gone": "Gone.msg: No such file",
        "my_msgs/srv/Bad_Request": "Bad.srv: my_msgs/srv/Bad",
        "my_msgs/msg/Nothing": "no interface 'my_msgs/msg/Nothing' in the catalogue",
    }
    for name, text in said.items():
        assert name not in catalogue
        with pytest.raises(UnknownTypeError, match=text):
            Catalogue(base=catalogue).get(name)
    with pytest.raises(UnknownTypeError, match="my_msgs/msg/Nothing"):
        message_class("my_msgs/msg/Lost", catalogue)
    assert message_class("my_msgs/msg/Good", catalogue)(a=1).a == 1
    assert message_class("std_msgs/msg/String", catalogue)().data == ""
    assert len(caplog.records) == 6  # each file once, however often it was asked for


def test_folders_are_bounded(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(own, {f"my_msgs/msg/M{number}.msg": "int8 a" for number in range(20)})
    assert len(fresh().names_of("my_msgs")) == 20
    object.__setattr__(LIMITS, "type_cache", 7)
    try:
        assert len(fresh().names_of("my_msgs")) == 7
    finally:
        object.__setattr__(LIMITS, "type_cache", 4096)
    monkeypatch.delenv("METAROS_INTERFACE_PATH")
    assert fresh().names_of("my_msgs") == []


def test_strange_names_reach_no_file(own: Path) -> None:
    write(own, {"my_msgs/msg/Good.msg": "int8 a", "secret/msg/Good.msg": "int8 a"})
    for name in (
        "../secret/msg/Good",
        "my_msgs/msg/../../secret/msg/Good",
        "/my_msgs/msg/Good",
        "",
        "my_msgs/msg/good",
    ):
        assert name not in fresh()

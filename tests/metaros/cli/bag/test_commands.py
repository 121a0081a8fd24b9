"""`metaros bag …`: the files' commands in this process, what people and machines read."""

from __future__ import annotations

import json
import signal
from pathlib import Path

import pytest

from metaros.cli.bag.view import missing_text
from metaros.interfaces.geometry_msgs.msg import Point
from metaros.interfaces.std_msgs.msg import String
from tests.metaros.cli.conftest import Run
from tests.support.nodes.bags import arrivals, write_bag
from tests.support.processes.command_line import Done, call_metaros, program
from tests.support.processes.processes import END_S, started
from tests.support.waiting import wait_until


@pytest.fixture
def bag(tmp_path: Path) -> str:
    """Two topics of a second, with a gap and a sample that was dropped."""
    strings = arrivals("/chatter", [String(data=f"hello {n}") for n in range(100)])
    strings[0][0].publisher.refuse(51, "dropped")
    del strings[50], strings[20:23]
    write_bag(tmp_path / "run", strings, arrivals("/point", [Point(x=float(n)) for n in range(50)]))
    return str(tmp_path / "run")


def bag_run(*arguments: str) -> Done:
    """`metaros bag …` without a router."""
    return call_metaros("bag", *arguments)


def test_info_for_people(bag: str) -> None:
    done = bag_run("info", bag, "-v")
    assert done.code == 0
    assert "146 on 2 topics" in done.out
    assert "gaps       4 on 1 topic: 3 never arrived, 1 dropped (the disk was too slow)" in done.out
    assert "lost 21-23 dropped 51" in done.out
    assert "std_msgs/msg/String" in done.out


def test_info_for_machines(bag: str) -> None:
    facts = json.loads(bag_run("info", bag, "-o", "json").out)
    assert facts["messages"] == 146
    assert facts["topics"][0]["missing"] == {"lost": 3, "dropped": 1}
    assert facts["topics"][1]["rate_hz"] == pytest.approx(50, rel=0.1)
    assert facts["compression"] == ["zstd"]


def test_info_of_a_file_without_an_end(bag: str, tmp_path: Path) -> None:
    whole = (Path(bag) / "run_0.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: len(whole) // 2])
    done = bag_run("info", str(tmp_path / "cut.mcap"))
    assert done.code == 0
    assert "damaged    cut.mcap: no index" in done.out
    assert "metaros bag recover" in done.out
    assert bag_run("recover", str(tmp_path / "cut.mcap"), str(tmp_path / "sound.mcap")).code == 0
    assert "damaged" not in bag_run("info", str(tmp_path / "sound.mcap")).out


def test_cut_and_export(bag: str, tmp_path: Path) -> None:
    piece = str(tmp_path / "piece.mcap")
    done = bag_run("cut", bag, piece, "--topics", "/point", "--start", "0.1", "--duration", "0.2", "-o", "json")
    assert json.loads(done.out)["messages"] == 20
    lines = bag_run("export", piece).out.splitlines()
    assert len(lines) == 20
    assert json.loads(lines[0])["message"]["x"] == 10.0
    tables = str(tmp_path / "tables")
    assert bag_run("export", piece, tables, "-f", "csv", "--field", "x").out == f"{tables}/point.csv: 20 rows\n"
    assert bag_run("export", piece, tables, "-f", "csv").code == 2  # never overwritten
    assert bag_run("export", piece, "-f", "csv").code == 2
    assert "nothing to export" in bag_run("export", piece, str(tmp_path / "pictures"), "-f", "images").err
    one = str(tmp_path / "lines.json")
    assert bag_run("export", piece, one).out == f"{one}: 20 lines\n"


def test_errors(tmp_path: Path) -> None:
    for arguments, code, text in (
        (("info", str(tmp_path / "no")), 1, "no such recording"),
        (("record",), 2, "what is to be recorded?"),
        (("play", str(tmp_path), "--start-paused"), 2, "needs a terminal"),
        (("play", str(tmp_path), "--zenoh-port", "1"), 1, "router"),
    ):
        done = bag_run(*arguments)
        assert done.code == code
        assert text in done.err


@pytest.mark.usefixtures("talker")
def test_record_until_ctrl_c(zenoh_port: str, tmp_path: Path) -> None:
    options = ["--target", str(tmp_path / "out"), "--split-s", "0.05", "-o", "json"]
    with started(program("bag", "record", "/chatter", *options, "--zenoh-port", zenoh_port)) as recorder:
        wait_until(lambda: (tmp_path / "out" / "out_1.mcap").exists() or recorder.poll() is not None)
        recorder.send_signal(signal.SIGINT)
        out, err = recorder.communicate(timeout=END_S)
    assert recorder.returncode == 0, err
    facts = json.loads(out.splitlines()[-1])
    assert facts["messages"] > 1
    assert facts["topics"] == 1


@pytest.mark.usefixtures("talker")
def test_record_for_a_time_play_and_save(run: Run, bag: str, tmp_path: Path) -> None:
    done = run("bag", "record", "/chatter", "--target", str(tmp_path / "out"), "--duration", "0.1", "-o", "json")
    assert (done.code, json.loads(done.out)["missing"]) == (0, {})
    done = run("bag", "play", bag, "--rate", "0", "--wait", "0", "--remap", "/chatter:=/again", "-o", "json")
    assert json.loads(done.out)["messages"] == 146
    assert run("play", bag, "--rate", "0", "--wait", "0").out.startswith("146 messages on 2 topics")
    assert run("bag", "play", bag, "--remap", "nonsense").code == 2
    assert "no recorder" in run("bag", "save").err


def test_what_is_missing_in_words() -> None:
    assert missing_text({"/b": {"lost": 2}, "/a": {"paused": 1, "lost": 1}}) == (
        "4 on 2 topics: 3 never arrived, 1 came during a pause"
    )
    assert missing_text({}) == ""

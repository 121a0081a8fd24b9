"""The benchmark against peers as a command, with tiny rounds: that it measures, not what."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

import pytest

from load_tests.benchmarks.library import peers
from load_tests.peers import venvs
from load_tests.peers.results import Results
from load_tests.peers.rows import chosen, planned

TINY = ["--rounds", "1", "--seconds", "0.1", "--sizes", "64"]


@pytest.fixture(autouse=True)
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The latest results of whoever works here stay as they are."""
    monkeypatch.setattr(peers, "FOLDER", tmp_path / "peers")


@pytest.mark.integration
def test_metaros_beside_raw_zenoh(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, chart = tmp_path / "results.json", tmp_path / "chart.svg"
    only = ["--only", "zenoh-bare,metaros-dedicated", "--json", str(file), "--svg", str(chart)]
    assert peers.main([*TINY, *only]) == 0
    shown = capsys.readouterr().out
    assert "Goals" in shown
    assert "failed" not in shown
    results = Results.load(file)
    for key in ("zenoh-bare", "metaros-dedicated"):
        cell = results.cells[64, key]
        assert cell.errors == []
        assert cell.median("rate") is not None
        assert cell.median("p99_us") >= cell.median("p50_us") > 0  # type: ignore[operator]
        if sys.platform == "linux":
            assert cell.median("threads_sub") >= 2  # type: ignore[operator]
            assert cell.median("resident_sub") > 1 << 20  # type: ignore[operator]
            assert cell.median("objects_sub") > 1 << 20  # type: ignore[operator]
    assert chart.read_text().startswith("<svg")
    assert peers.main(["--markdown", str(file)]) == 0
    assert "| metaros typed, dedicated |" in capsys.readouterr().out
    assert Results.load(tmp_path / "peers" / "latest.json").cells.keys() == results.cells.keys()


def test_a_peer_that_cannot_run_has_its_reason_in_its_row(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    nowhere = venvs.Home(module="no_such_module", missing="not installed (Debian: python3-rospy)")
    monkeypatch.setitem(venvs.HOMES, "rospy", nowhere)
    assert peers.main([*TINY, "--only", "rospy"]) == 0
    shown = capsys.readouterr().out
    assert "rospy (Debian): not installed (Debian: python3-rospy)" in shown


@pytest.mark.parametrize(
    ("argv", "said"),
    [
        (["--only", "nobody"], "unknown peer nobody"),
        (["--sizes", "0"], "--sizes within"),
        (["--rounds", "0"], "--rounds from 1"),
        (["--markdown", "nowhere.json"], "nowhere.json"),
    ],
)
def test_what_cannot_be_asked(argv: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        peers.main(argv)
    assert said in capsys.readouterr().err


def test_the_default_run_fits_into_a_quarter_of_an_hour() -> None:
    default = len(planned(chosen([]), peers.SIZES))
    quick = len(planned(chosen([], quick=True), peers.QUICK_SIZES))
    assert peers.estimate_s(default, 5, 1.0) <= 15 * 60
    assert peers.estimate_s(quick, 5, peers.QUICK_S) <= 3 * 60


@pytest.mark.integration
@pytest.mark.skipif(sys.platform != "linux", reason="the peers' environments are made for Linux")
def test_peers_of_other_environments(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "results.json"
    try:
        venvs.python_of("peers")
    except venvs.HomeFailed as error:
        pytest.skip(f"no package index: {error}")
    assert peers.main([*TINY, "--only", "pyzmq,cyclonedds", "--json", str(file)]) == 0
    shown = capsys.readouterr().out
    cells = json.loads(file.read_text())["cells"]
    assert [(cell["row"], cell["errors"]) for cell in cells] == [("cyclonedds", []), ("pyzmq", [])], shown
    assert all(cell["flood"][0]["rate"] >= 0 and cell["ping"][0]["p50_us"] > 0 for cell in cells)


def test_every_row_and_option_is_documented(capsys: pytest.CaptureFixture[str]) -> None:
    page = Path("docs/reference/benchmarks.md").read_text()
    assert [row.key for row in chosen([]) if f"| `{row.key}` |" not in page] == []
    with pytest.raises(SystemExit):
        peers.main(["--help"])
    options = set(re.findall(r"--[a-z]+", capsys.readouterr().out)) - {"--help"}
    assert [option for option in sorted(options) if f"| `{option}" not in page] == []

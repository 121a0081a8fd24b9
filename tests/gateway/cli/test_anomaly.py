"""`metaros anomaly score`: one score a row from a pipe or a file, and what it says to rows that are none."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner, Result

from gateway.alerting.anomaly.detectors.stream import Stream
from gateway.cli.anomaly import read_samples, register
from metaros.errors import UsageError

HEADER = "timestamp,value\n"
START_S = 1_767_225_600.0


def score(text: str = "", *arguments: str) -> Result:
    app = typer.Typer()
    register(app)
    app.command("other")(lambda: None)  # one command alone would have no name
    return CliRunner().invoke(app, ["anomaly", "score", *arguments], input=text)


def wave(rows: int) -> str:
    return HEADER + "".join(f"{START_S + 300 * at},{99 if at == rows - 1 else at % 12}\n" for at in range(rows))


def test_one_score_a_row_and_nothing_else(tmp_path: Path) -> None:
    piped = score(wave(400), "-")
    assert piped.exit_code == 0, piped.output
    scores = [float(line) for line in piped.output.splitlines()]
    stream = Stream()
    assert scores == [stream.update(START_S + 300 * at, 99.0 if at == 399 else at % 12) for at in range(400)]
    assert scores[-1] >= 0.5 > max(scores[:-1])
    (tmp_path / "wave.csv").write_text("\ufeff" + wave(400))
    assert score("", str(tmp_path / "wave.csv")).output == piped.output
    assert score(wave(400)).output == piped.output


def test_times_and_values_as_people_write_them() -> None:
    rows = (
        "2026-01-01 00:00:00,1",
        "2026-01-01T00:00:00Z,2.5",
        "2026-01-01T02:00:00+02:00, 3",
        f"{START_S},",
        "1767225600.0,nan",
        "1767225600,-inf",
    )
    found = list(read_samples([HEADER, *(f"{row}\n" for row in rows), "\n"]))
    assert [stamp_s for stamp_s, _ in found] == [START_S] * 6
    assert [value for _, value in found][:3] == [1.0, 2.5, 3.0]
    assert score(HEADER + "\n".join(rows)).output == "0.0\n" * 6
    assert list(read_samples(["id,Value,Timestamp\n", "7,4,5\n"])) == [(5.0, 4.0)]
    assert score(HEADER).output == ""


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "line 1: no header with timestamp and value"),
        ("2026-01-01,5\n", "line 1: no header"),
        (HEADER + "1,2\nnoon,3\n", "line 3: timestamp 'noon' is neither ISO 8601 nor seconds"),
        (HEADER + "1,warm\n", "line 2: value 'warm' is no number"),
        (HEADER + "1\n", "line 2: 1 columns"),
        (HEADER + "1," + "9" * 200_000 + "\n", "line 2: field larger than field limit"),
    ],
)
def test_a_row_that_is_none_is_named_by_its_line(text: str, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        list(read_samples(text.splitlines(keepends=True)))
    result = score(text)
    assert isinstance(result.exception, UsageError)
    assert result.exception.code == "usage"


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    assert "No such file" in str(score("", str(tmp_path / "gone.csv")).exception)


def test_a_score_comes_as_soon_as_its_row() -> None:
    command = [sys.executable, "-c", "from metaros.cli.main import main; main(['anomaly', 'score', '-'])"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin
        assert process.stdout
        process.stdin.write(HEADER + "1,1\n")
        process.stdin.flush()
        assert process.stdout.readline() == "0.0\n"
        process.stdin.close()
        assert process.wait(60) == 0


def test_the_help_imports_no_numpy() -> None:
    for words in (["--help"], ["anomaly", "--help"]):
        code = f"import sys\nfrom metaros.cli.main import main\ntry: main({words})\nexcept SystemExit: pass\n"
        code += "sys.exit('numpy' in sys.modules)"
        assert subprocess.run([sys.executable, "-c", code], stdout=subprocess.DEVNULL, timeout=60).returncode == 0

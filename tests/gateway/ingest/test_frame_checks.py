"""Frames that a session checks by their form alone: the report of a twin."""

from __future__ import annotations

import pytest

from gateway.errors import ProtocolError
from gateway.ingest.frame_checks import read_twin
from metaros._proto import link_pb2
from metaros.limits import LIMITS

CONTROL, DATA = link_pb2.LANE_CONTROL, link_pb2.LANE_DATA


def test_a_report_is_handed_on_as_it_is() -> None:
    report = link_pb2.TwinReport(revision=3, applied=2, state="confirming", sha256=bytes(32), reported=b"{}")
    assert read_twin(CONTROL, report, limits=LIMITS).report == report


@pytest.mark.parametrize(
    ("lane", "report", "says"),
    [
        (DATA, link_pb2.TwinReport(state="applied"), "lane"),
        (CONTROL, link_pb2.TwinReport(state="dancing"), "state"),
        (CONTROL, link_pb2.TwinReport(state="applied", sha256=b"12"), "checksum"),
        (CONTROL, link_pb2.TwinReport(state="applied", reported=bytes(LIMITS.twin_report_bytes)), "at most"),
    ],
)
def test_a_report_of_a_wrong_form_is_refused(lane: int, report: link_pb2.TwinReport, says: str) -> None:
    with pytest.raises(ProtocolError, match=says):
        read_twin(lane, report, limits=LIMITS)

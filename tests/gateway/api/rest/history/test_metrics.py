"""Ranges of series over HTTP: buckets, lines, and what is missing."""

from __future__ import annotations

from pathlib import Path

from gateway.api.models import common
from metaros._proto import link_pb2
from tests.gateway.harness import DATA, EPOCH, ScriptedAgent, client, running_gateway

SERIES = link_pb2.Series(series_id=1, name="battery.x", topic="/sim_1/battery", field="x")
RANGE = "/api/v1/robots/sim_1/metrics/range"
SECOND_NS = 10**9


async def test_buckets_lines_and_losses(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready) as http, ScriptedAgent(ready) as agent:
        await agent.announce(series=[SERIES])
        await agent.rows(1, [(1, number * SECOND_NS, float(number == 40)) for number in range(100)])
        for stream_id, from_seq, from_ns in ((0, 101, 60 * SECOND_NS), (0, 111, 300 * SECOND_NS)):
            gap = link_pb2.Gap(stream_id=stream_id, epoch=EPOCH, from_seq=from_seq, to_seq=from_seq + 9)
            gap.reason, gap.from_ns, gap.to_ns = "outbox_full", from_ns, from_ns + SECOND_NS
            await agent.send(gap=gap)
        while (await agent.next("ack", DATA)).ack.watermarks[0].seq < 120:
            pass
        query = {"name": "battery.x", "start": "1970-01-01T00:00:00Z", "end": "1970-01-01T00:01:39Z", "points": "10"}
        answer = await http.get(RANGE, params=query)
        common.MetricRange.model_validate_json(answer.content)
        (buckets,) = answer.json()["series"]
        assert (sum(buckets["count"]), buckets["max"].index(1.0)) == (100, 4)
        assert answer.json()["gaps"] == [[60_000.0, 61_000.0, 10, "outbox_full"]]
        line = (await http.get(RANGE, params={**query, "method": "lttb"})).json()["series"][0]
        assert line["count"] == [1] * 10
        assert (line["stamp_ms"][0], line["stamp_ms"][-1], 40_000.0 in line["stamp_ms"]) == (0.0, 99_000.0, True)
        refused = await http.get(RANGE, params={**query, "method": "magic"})
        assert (refused.status_code, refused.json()["code"]) == (400, "invalid_request")
        refused = await http.get(RANGE, params={**query, "start": "-999999999d"})
        assert (refused.status_code, refused.json()["detail"]) == (400, "time '-999999999d' is out of range")

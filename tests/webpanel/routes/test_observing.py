"""Metrics as Prometheus reads them, and health."""

import httpx
from prometheus_client.openmetrics.parser import text_string_to_metric_families as openmetrics
from prometheus_client.parser import text_string_to_metric_families

from tests.webpanel.memory_service import MemoryService
from tests.webpanel.serving import refused


def test_prometheus_reads_the_metrics(client: httpx.Client) -> None:
    client.get("/api/status")
    client.get("/api/nothing")
    answer = client.get("/metrics")
    assert answer.headers["content-type"].startswith("text/plain; version=")
    families = {family.name: family for family in text_string_to_metric_families(answer.text)}
    frames = families["svev_frames"]
    assert frames.type == "counter"
    assert {sample.labels["camera"]: sample.value for sample in frames.samples} == {"K1": 10.0, 'K"2\n': 11.0}
    assert [sample.value for sample in families["svev_disk_free_bytes"].samples] == [1e11]
    latency = families["svev_latency_seconds"]
    assert latency.type == "histogram"
    samples = {(sample.name, sample.labels.get("le")): sample.value for sample in latency.samples}
    assert samples["svev_latency_seconds_bucket", "0.1"] == 9.0
    assert samples["svev_latency_seconds_count", None] == 10.0
    assert samples["svev_latency_seconds_sum", None] == 0.7
    requests = {tuple(s.labels.values()): s.value for s in families["svev_http_requests"].samples}
    assert requests["GET", "200"] == 1.0
    assert requests["GET", "404"] == 1.0


def test_programs_that_accept_openmetrics_get_it(client: httpx.Client) -> None:
    accepted = "application/openmetrics-text; version=1.0.0, text/plain; version=0.0.4; q=0.5"  # as Prometheus asks
    answer = client.get("/metrics", headers={"Accept": accepted})
    assert answer.headers["content-type"].startswith("application/openmetrics-text; version=1.0.0")
    assert answer.headers["vary"] == "Accept"
    assert answer.text.endswith("# EOF\n")
    families = {family.name: family for family in openmetrics(answer.text)}  # type: ignore[no-untyped-call]
    assert {sample.name for sample in families["svev_frames"].samples} == {"svev_frames_total"}
    assert families["svev_latency_seconds"].type == "histogram"


def test_invented_methods_make_no_series_of_their_own(client: httpx.Client) -> None:
    for number in range(5):
        refused(client.request(f"INVENTED{number}", "/api/status"), 405)
    text = client.get("/metrics").text
    assert "INVENTED" not in text
    assert 'method="other"' in text


def test_health(client: httpx.Client, service: MemoryService) -> None:
    assert client.get("/healthz").json() == {"healthy": True}
    service.well = False
    answer = client.get("/healthz")
    assert answer.status_code == 503
    assert answer.json() == {"healthy": False}

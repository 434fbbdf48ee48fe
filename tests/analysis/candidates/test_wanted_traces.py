"""Traces are sought where and when they are wanted."""

from collections.abc import Sequence

import numpy as np
import pytest

from analysis.candidates.finder import Finder
from analysis.candidates.foreground.background import Region
from analysis.candidates.model import ExpectedSki, ImageCandidates, Trace
from analysis.candidates.skis import wanted_traces
from analysis.candidates.skis.traces import find_traces
from analysis.candidates.skis.wanted_traces import WantedTraces
from tests.analysis.candidates.judge import Hill, scenario

PULSE = 43  # in flight: every camera shows a ski at least


@pytest.fixture(scope="module")
def hill() -> Hill:
    return Hill(scenario())


def test_only_what_is_near_is_searched_and_only_once(hill: Hill, monkeypatch: pytest.MonkeyPatch) -> None:
    searched: list[Region] = []

    def search(region: Region, expected: Sequence[ExpectedSki]) -> tuple[Trace, ...]:
        searched.append(region)
        return find_traces(region, expected)

    monkeypatch.setattr(wanted_traces, "find_traces", search)
    images = hill.find(PULSE).images
    assert not searched, "whoever looks for spots does not pay for traces"
    nowhere = np.array(((np.nan, np.nan), (-300.0, -300.0)))
    reach = np.array((40.0,))
    for image in images.values():
        assert _wanted(image).near(nowhere, np.array((50.0, 50.0))) == ()
    assert not searched
    for image in images.values():
        near = _wanted(image).near(image.spots.xy[:1], reach)
        assert near
        before = len(searched)
        assert _wanted(image).near(image.spots.xy[:1], reach) == near
        assert len(searched) == before, "the same part is not searched twice"
        assert set(map(id, near)) <= set(map(id, image.traces))


def test_traces_outlast_the_memory_for_second_looks(hill: Hill) -> None:
    images = {name: list(image.traces) for name, image in hill.find(PULSE).images.items()}
    small = Finder(hill.static, memory=1)
    found = small.find(hill.tag(PULSE), hill.triplet(PULSE))
    small.find(hill.tag(PULSE + 1), hill.triplet(PULSE + 1))
    for name, image in found.images.items():
        same = zip(image.traces, images[name], strict=True)
        assert all(np.array_equal(one.xy, other.xy) for one, other in same)


def test_what_is_changed_is_changed_when_it_is_found(hill: Hill) -> None:
    def longest(traces: tuple[Trace, ...]) -> tuple[Trace, ...]:
        return traces[:1]

    for image in hill.find(PULSE).images.values():
        changed = _wanted(image).changed(longest)
        assert list(changed) == list(image.traces)[:1]


def test_pixels_are_given_back_where_only_changed_traces_are_kept(hill: Hill, monkeypatch: pytest.MonkeyPatch) -> None:
    small = Finder(hill.static, memory=1)
    kept = [_wanted(image).changed(tuple) for image in small.find(hill.tag(PULSE), hill.triplet(PULSE)).images.values()]
    small.find(hill.tag(PULSE + 1), hill.triplet(PULSE + 1))
    monkeypatch.setattr(wanted_traces, "find_traces", lambda *_: pytest.fail("searched after they were forgotten"))
    assert len(kept[-1]), "that of the last camera was forgotten last"


def _wanted(image: ImageCandidates) -> WantedTraces:
    assert isinstance(image.traces, WantedTraces)
    return image.traces

"""The list of recordings and the trash in a browser: long lists, filters, several at once, what cannot be shown."""

import json
import re
import shutil
import zipfile
from pathlib import Path

import av
import httpx
import pytest
from playwright.sync_api import expect

from recorder.reading.corrected_log import corrected_log
from rig.api.jump import MeasuredValue
from rig.frame import FrameStatus
from service.measuring.keeping import keep_result
from tests.browser.conftest import MEASURED, Open, keep_measured, write_kinogram
from tests.browser.views import assert_fits_a_phone, enter
from tests.recorder.logs import ALL_OK
from tests.recorder.split import split_log
from tests.support.waiting import wait_until
from tests.webpanel.memory_service import MemoryService, write_recording
from tests.webpanel.serving import Panel

LOST = (FrameStatus.LOST, *ALL_OK[1:])


@pytest.fixture
def many(service: MemoryService, tmp_path_factory: pytest.TempPathFactory) -> None:
    """120 recordings of bibs 1 to 120."""
    first = write_recording(tmp_path_factory.mktemp("first"), "first", (ALL_OK,) * 2)
    for number in range(1, 121):
        with corrected_log(first, {"athlete": f"Athlete {number}", "bib": str(number)}).open() as log:
            (service.catalogue.directory / f"jump-{number:03}.mcap").write_bytes(log.read())


@pytest.fixture
def few(service: MemoryService) -> None:
    """A complete recording, one that lacks a frame, one without any pulse."""
    folder = service.catalogue.directory
    write_recording(folder, "whole", (ALL_OK,) * 3, {"athlete": "Anna Berg", "bib": "17"}, ago_s=20)
    write_recording(folder, "partial", (LOST, ALL_OK), {"athlete": "Ola Lie", "bib": "4"}, ago_s=10)
    write_recording(folder, "empty", (), {"bib": "9"})


def test_a_split_recording_is_taken_away_whole_or_part_by_part(
    panel: Panel, service: MemoryService, open_page: Open, tmp_path: Path
) -> None:
    whole = write_recording(tmp_path, "whole", (ALL_OK,) * 9, {"athlete": "Anna Berg", "bib": "17"})
    split_log(whole, service.catalogue.directory / "long.mcap", (4, 3))
    page = open_page(f"{panel.url}/#/recordings/long", width=360, height=780, locale="nb-NO")
    everything, single = page.locator("#recording-parts-all"), page.locator("#recording-parts")
    expect(everything).to_have_text("Last ned alle 3 deler (ZIP)")
    with page.expect_download() as taken:
        everything.click()
    with zipfile.ZipFile(taken.value.path()) as archive:
        logs = [name for name in archive.namelist() if name.endswith(".mcap")]
    assert logs == [f"17_Anna-Berg_long{part}.mcap" for part in ("", "-part2", "-part3")]
    single.locator("summary").click()
    with page.expect_download() as taken:
        single.get_by_role("link", name="Del 2").click()
    assert taken.value.suggested_filename == "17_Anna-Berg_long-part2.mcap"
    assert_fits_a_phone(page)


@pytest.mark.usefixtures("many")
def test_a_long_list_comes_as_it_is_scrolled_and_keeps_its_place(panel: Panel, open_page: Open) -> None:
    page = open_page("about:blank", width=360, height=780, locale="nb-NO", has_touch=True, is_mobile=True)
    thumbnails: list[str] = []
    page.on("request", lambda request: thumbnails.append(request.url) if "thumbnail" in request.url else None)
    page.goto(f"{panel.url}/#/recordings")
    rows = page.locator("#recordings-list li")
    expect(rows).to_have_count(50)
    assert len(thumbnails) < 50
    page.evaluate("scrollTo(0, document.body.scrollHeight)")
    expect(rows).to_have_count(100)
    link = page.locator('a[href="#/recordings/jump-041"]')
    link.scroll_into_view_if_needed()
    before = page.evaluate("scrollY")
    assert before > 5000
    link.click()
    expect(page.locator("#frame-strip li")).to_have_count(1)
    page.go_back()
    expect(rows).to_have_count(100)
    expect(link).to_be_in_viewport()
    assert abs(page.evaluate("scrollY") - before) < 400

    page.get_by_role("searchbox").fill("athlete 77")
    expect(rows).to_have_count(1)
    expect(page.locator("#recordings-count")).to_have_text("1 funnet")
    page.get_by_role("searchbox").fill("")
    page.get_by_role("button", name="Filter").click()
    page.get_by_label("Rekkef\u00f8lge").select_option("bib")
    expect(page.locator("#recordings-list strong").first).to_have_text("1 \u00b7 Athlete 1")
    expect(page.locator("#recordings-list .day")).to_have_count(0)
    assert page.evaluate("document.documentElement.scrollWidth") == 360


@pytest.mark.usefixtures("few")
def test_several_are_downloaded_deleted_and_removed_for_good(
    panel: Panel, service: MemoryService, open_page: Open, tmp_path: Path
) -> None:
    page = open_page(f"{panel.url}/#/recordings")
    expect(page.locator("#recordings-list li")).to_have_count(3)
    page.get_by_role("button", name="Select").click()
    expect(page.locator("#select-delete")).to_be_disabled()
    page.get_by_role("checkbox", name="Select 17").check()
    page.get_by_role("checkbox", name="Select 4").check()
    expect(page.locator("#select-count")).to_contain_text("2 selected")
    with page.expect_download() as coming:
        page.get_by_role("link", name="Download").click()
    assert coming.value.suggested_filename == "svev_2-jumps.zip"
    coming.value.save_as(tmp_path / "jumps.zip")
    with zipfile.ZipFile(tmp_path / "jumps.zip") as archive:
        assert set(archive.namelist()) == {"17_Anna-Berg_whole.mcap", "4_Ola-Lie_partial.mcap", "SHA256SUMS"}

    page.get_by_role("button", name="Delete", exact=True).click()
    expect(page.locator("#recordings-list li")).to_have_count(1)
    page.get_by_role("button", name="Undo").click()
    expect(page.locator("#recordings-list li")).to_have_count(3)
    page.get_by_role("button", name="Select").click()
    page.get_by_role("button", name="All shown").click()
    page.get_by_role("button", name="Delete", exact=True).click()
    page.get_by_role("link", name="Trash").click()
    expect(page.locator("#trash-words")).to_contain_text("3 jumps take")
    page.locator("li", has_text="Anna Berg").get_by_role("button", name="Restore").click()
    expect(page.locator("#trash-words")).to_contain_text("2 jumps take")
    for answer, left in (("Cancel", 2), ("Remove for good", 0)):
        page.get_by_role("button", name="Empty the trash").click()
        page.get_by_role("dialog").get_by_role("button", name=answer).click()
        expect(page.locator("#recordings-list li")).to_have_count(left)
    expect(page.locator("#recordings-empty")).to_have_text("The trash is empty.")
    assert service.trash().recordings == 0
    assert [entry.id for entry in service.catalogue.entries()] == ["whole"]


@pytest.mark.usefixtures("few")
def test_what_cannot_be_shown_never_shows_the_jump_before(
    panel: Panel, service: MemoryService, open_page: Open
) -> None:
    data = (service.catalogue.directory / "whole.mcap").read_bytes()
    (service.catalogue.directory / "headless.mcap").write_bytes(bytes(4096) + data[4096:])
    page = open_page(f"{panel.url}/#/recordings/whole")
    for name, words in (
        ("nobody", "There is no such jump"), ("empty", "There is nothing to look at"), ("..", "There is no such jump"),
        ("headless", "There is nothing to look at"),
    ):  # fmt: skip
        page.goto(f"{panel.url}/#/recordings/whole")
        expect(page.locator("#frame-where")).to_have_text(re.compile("^1 / 3"))
        page.goto(f"{panel.url}/#/recordings/{name}")
        expect(page.locator("#recording-empty")).to_contain_text(words)
        expect(page.locator("#player")).to_be_hidden()
        assert "Anna Berg" not in page.locator("#recording").inner_text()
    expect(page.locator("#recording-recover")).to_contain_text("svev recover headless.mcap -o headless-whole.mcap")
    page.goto(f"{panel.url}/#/recordings/nobody")
    expect(page.locator("#recording-columns")).to_be_hidden()


@pytest.mark.usefixtures("few")
def test_marks_and_filters(panel: Panel, open_page: Open) -> None:
    page = open_page(f"{panel.url}/#/recordings/whole")
    page.get_by_role("button", name="Favourite").click()
    expect(page.get_by_role("button", name="Favourite")).to_have_attribute("aria-pressed", "true")
    page.get_by_label("Tags").fill("fall,  new boots ,")
    page.keyboard.press("Tab")
    expect(page.get_by_label("Tags")).to_have_value("fall, new boots")
    page.goto(f"{panel.url}/#/recordings")
    expect(page.locator("#recordings-list .tags")).to_have_text("fallnew boots")
    page.get_by_role("button", name="Filter").click()
    for name, value in (("favourite", None), ("tag", "Fall"), ("verdict", "good")):
        field = page.locator(f"#filter-{name}")
        if value is None:
            field.check()
        elif name == "tag":
            field.fill(value)
        else:
            field.select_option(value)
        expect(page.locator("#recordings-list li")).to_have_count(1)
        page.get_by_role("button", name="Clear all").click()
        expect(page.locator("#recordings-list li")).to_have_count(3)
    page.get_by_label("From day").fill("2099-01-01")
    expect(page.locator("#recordings-empty")).to_have_text("No jump fits this search and these filters.")
    expect(page.locator("#filters-toggle")).to_have_text("Filter (1)")


def test_conditions_are_added_shown_and_taken_away_on_a_phone(
    panel: Panel, service: MemoryService, open_page: Open
) -> None:
    for name, alpha in (("low", 47.0), ("high", 49.0)):
        log = write_recording(service.catalogue.directory, name, (ALL_OK,), {"athlete": "Anna Berg"})
        angle = MeasuredValue(value=alpha, sigma=0.5)
        keep_measured(log, (MEASURED.model_copy(update={"recording": name, "ski_to_body": angle}),))
    page = open_page(f"{panel.url}/#/recordings", width=360, height=780)
    rows, chips = page.locator("#recordings-list li a.summary"), page.locator("#recordings-chips button")
    expect(rows).to_have_count(2)
    expect(chips).to_have_count(0)
    page.get_by_role("button", name="Filter").click()
    page.get_by_label("Number").fill("48")
    page.get_by_role("button", name="Add").click()
    expect(page.get_by_role("searchbox")).to_have_value("alpha > 48")
    expect(rows).to_have_count(1)
    expect(rows).to_have_attribute("href", "#/recordings/high")
    page.get_by_role("searchbox").fill("anna alpha > 46 date>2020")
    expect(rows).to_have_count(2)
    expect(chips).to_have_text([re.compile("^alpha > 46"), re.compile("^date>2020")])
    page.get_by_role("searchbox").fill("anna alpha > 48 takeoff > 90")
    expect(rows).to_have_count(0)
    page.get_by_role("button", name="Search without takeoff > 90").click()
    expect(rows).to_have_count(1)
    expect(page.get_by_role("searchbox")).to_have_value("anna alpha > 48")
    assert page.evaluate("document.documentElement.scrollWidth") == 360
    page.get_by_role("searchbox").fill("gamma > 3")
    expect(page.get_by_text("gamma cannot be compared with a number")).to_be_visible()


def test_a_jump_opens_at_its_take_off_is_played_slowly_in_a_loop_noted_and_exported(
    panel: Panel, service: MemoryService, client: httpx.Client, open_page: Open
) -> None:
    log = write_recording(service.catalogue.directory, "jump", (ALL_OK,) * 60)
    log.with_suffix(".jumper.json").write_text('{"jumps": [{"takeoff": {"pulse": 31.2}}]}')
    page = open_page(f"{panel.url}/#/recordings/jump", width=360, height=780, locale="nb-NO")
    where = page.locator("#frame-where")
    expect(where).to_have_text(re.compile("^31 / 60"))
    page.keyboard.press("End")
    expect(where).to_have_text(re.compile("^60 / 60"))
    page.locator("#frame-more").click()
    page.locator("#frame-moment").click()
    expect(where).to_have_text(re.compile("^31 / 60"))
    expect(page.locator("#frame-png")).to_have_attribute("href", re.compile("pulses/31.png"))
    page.keyboard.press("m")
    page.keyboard.type("åpne ski")
    page.keyboard.press("Enter")
    expect(page.locator("#notes li")).to_have_text(re.compile("31.*åpne ski"))
    assert client.get("/api/recordings/jump/notes").json() == [{"pulse": 31, "text": "åpne ski"}]
    page.keyboard.press("-")
    expect(page.locator("#frame-speed")).to_have_value("2")
    page.keyboard.press("o")
    expect(page.locator("#frame-play")).to_have_attribute("aria-label", "Pause")
    expect(page.locator("#frame-speed")).to_have_value("2")  # slow already: as chosen
    page.keyboard.press("End")
    page.keyboard.press(" ")  # in a loop the beginning of the stretch follows its end
    expect(page.locator("#frame-play")).to_have_attribute("aria-label", "Pause")
    expect(where).to_have_text(re.compile("^(1[6-9]|2[0-9]) / 60"))
    page.keyboard.press("Home")
    page.locator("#notes .note").click()
    expect(where).to_have_text(re.compile("^31 / 60"))
    page.locator("#export-kind").select_option("csv")
    expect(page.locator("#export-slow")).to_be_disabled()
    page.locator("#export-form button[type=submit]").click()
    with page.expect_download() as download:
        page.locator("#exports a").click()
    assert download.value.suggested_filename == "jump.csv"
    page.locator("#exports button").click()
    expect(page.locator("#exports li")).to_have_count(0)


def test_two_jumps_are_compared_aligned_at_both_take_offs_or_by_motion_of_both(
    panel: Panel, service: MemoryService, open_page: Open
) -> None:
    takeoffs = {"one": ("Anna Berg", 20.4), "two": ("Anna Berg", 31.3), "three": ("Ola Lie", None)}
    for name, (athlete, takeoff) in takeoffs.items():
        log = write_recording(service.catalogue.directory, name, (ALL_OK,) * 40, {"athlete": athlete})
        if takeoff is not None:
            (made := log.with_name("made")).mkdir()
            (made / "jumper.json").write_text(json.dumps({"jumps": [{"takeoff": {"pulse": takeoff}}]}))
            keep_result(made, log, ())
    page = open_page(f"{panel.url}/#/recordings/one")
    expect(page.locator("#frame-where")).to_have_text(re.compile("^20 / 40"))
    expect(page.locator("#compare option")).to_have_count(3)
    assert page.locator("#compare option").nth(1).get_attribute("value") == "two/1"  # of the same athlete
    page.locator("#compare").select_option("two/1")
    how, where, picture = page.locator("#compare-how"), page.locator("#other-where"), page.locator("#other-frames img")
    expect(how).to_have_text("Aligned at the measured take-off of both.")
    expect(page.get_by_role("link", name="What differs")).to_have_attribute(
        "href", "./api/comparison.html?first=one&first_jump=1&second=two&second_jump=1&language=en"
    )
    expect(where).to_have_text(re.compile("^31 .* -0.010 s"))  # 0.3 pulses before its take-off
    page.locator("#frame-on").click()
    expect(where).to_have_text(re.compile("^32 .* 0.023 s"))
    expect(picture).to_have_attribute("src", re.compile("two/pulses/32.jpg"))
    ghost = page.locator("#frames .ghost")
    expect(ghost).to_be_hidden()
    page.get_by_role("button", name="Ghost").click()
    expect(page.locator("#other")).to_be_hidden()
    expect(ghost).to_have_attribute("src", re.compile("two/pulses/32.jpg"))
    page.locator("#frame-on").click()
    expect(ghost).to_have_attribute("src", re.compile("two/pulses/33.jpg"))
    page.keyboard.press("2")
    expect(ghost).to_have_css(
        "left", page.locator("#frames .plane img").first.evaluate("e => getComputedStyle(e).left")
    )
    page.get_by_role("button", name="Side by side").click()
    expect(page.locator("#other-frames")).to_have_class(re.compile("single"))
    page.keyboard.press("End")  # the other one ends earlier after its take-off, and stands still
    expect(where).to_have_text(re.compile("^40 "))

    # Of one the take-off is not measured: then both are aligned by motion, which noise alone has not.
    page.locator("#compare").select_option("three/1")
    expect(how).to_have_text("Both from their beginning: nothing moves in one of them.")
    expect(where).to_have_text(re.compile("^40 .* 1.300 s"))
    expect(page.get_by_role("link", name="What differs")).to_be_hidden()
    page.route(
        "**/moment?by_motion=true&jump=1",
        lambda route: route.fulfill(
            json={"pulse": 12 if "one" in route.request.url else 7, "kind": "activity", "exact": None}
        ),
    )
    page.locator("#compare").select_option("")
    expect(page.locator("#comparing")).to_be_hidden()
    page.keyboard.press("Home")
    page.locator("#compare").select_option("three/1")
    expect(how).to_have_text("Aligned where most moves in each: the take-off was not measured of both.")
    for _ in range(10):
        page.locator("#frame-on").click()
    expect(page.locator("#frame-where")).to_have_text(re.compile("^11 / 40"))
    expect(where).to_have_text(re.compile("^6 .* -0.033 s"))  # one pulse before that moment, as 11 is before 12
    page.locator("#compare").select_option("")
    expect(page.locator("#other")).to_be_hidden()


def test_twelve_jumps_of_a_recording_are_one_row_on_a_phone(
    panel: Panel, service: MemoryService, open_page: Open
) -> None:
    log = write_recording(service.catalogue.directory, "training", (ALL_OK,) * 40, {})
    (made := log.with_name("made")).mkdir()
    (made / "jumper.json").write_text(json.dumps({"jumps": []}))
    keep_result(made, log, tuple(MEASURED.model_copy(update={"jump": n, "ok": n != 9}) for n in range(1, 13)))
    page = open_page(f"{panel.url}/#/recordings/training/9", width=360, height=780, has_touch=True, is_mobile=True)
    choice = page.locator("#jump-choice")
    shown = choice.get_by_role("button", name="Jump 9")
    expect(shown).to_have_attribute("aria-pressed", "true")
    expect(shown).to_be_in_viewport(ratio=1)
    row, button = choice.bounding_box(), shown.bounding_box()
    assert row is not None
    assert button is not None
    assert button["height"] <= row["height"] < 1.5 * button["height"]
    expect(page.locator("#jump-verdict .mark")).to_have_text("Doubtful")
    assert_fits_a_phone(page)


def test_every_jump_of_a_recording_is_looked_at_and_compared(
    panel: Panel, service: MemoryService, open_page: Open
) -> None:
    takeoffs = {"one": (10.0,), "both": (12.0, 31.0)}
    for name, pulses in takeoffs.items():
        log = write_recording(service.catalogue.directory, name, (ALL_OK,) * 40, {"athlete": "Anna Berg"})
        (made := log.with_name("made")).mkdir()
        measured = [
            {"number": number, "takeoff": {"pulse": pulse}, "pulses": [{"pulse": int(pulse) + 3}]}
            for number, pulse in enumerate(pulses, 1)
        ]
        (made / "jumper.json").write_text(json.dumps({"jumps": measured}))
        write_kinogram(made, "4", "Anna Berg")
        for file in ("jumper.c3d", "jumper-2.c3d", "jumper.csv", "kinogram-2.jpg")[: 4 if len(pulses) > 1 else 1]:
            shutil.copy(made / "kinogram.jpg", made / file)
        found = [MEASURED.model_copy(update={"jump": n, "ok": n == 1}) for n in range(1, len(pulses) + 1)]
        keep_result(made, log, tuple(found))
    page = open_page(f"{panel.url}/#/recordings/both/2", width=360, height=780, has_touch=True, is_mobile=True)
    choice, where = page.locator("#jump-choice"), page.locator("#frame-where")
    expect(where).to_have_text(re.compile("^31 / 40"))
    expect(choice.get_by_role("button", name="Jump 2")).to_have_attribute("aria-pressed", "true")
    expect(page.locator("#kinogram-jumps img")).to_have_count(1)
    expect(page.locator("#measurement-jumps h3")).to_have_text(re.compile("^Jump 2, "))
    expect(page.locator("#measurement-jumps .mark")).to_have_text("Doubtful")
    expect(page.locator("#measurement-files a")).to_have_text(["C3D, jump 2", "CSV"])
    assert_fits_a_phone(page)
    page.locator("#frame-more").tap()
    page.locator("#compare").select_option("both/1")  # another one of the same recording
    expect(page.locator("#compare option")).to_have_text(
        ["no other jump", re.compile(r"Anna Berg, .*, Jump 1$"), re.compile(r"Anna Berg, [^,]*$")]
    )
    expect(page.locator("#compare-how")).to_have_text("Aligned at the measured take-off of both.")
    expect(page.locator("#other-where")).to_have_text(re.compile("^12 .* 0.000 s"))
    expect(page.locator("#compare-page")).to_have_attribute(
        "href", "./api/comparison.html?first=both&first_jump=2&second=both&second_jump=1&language=en"
    )
    page.locator("#compare").select_option("one/1")
    expect(page.locator("#other-where")).to_have_text(re.compile("^10 .* 0.000 s"))

    choice.get_by_role("button", name="Jump 1").tap()
    expect(where).to_have_text(re.compile("^12 / 40"))
    expect(page.locator("#measurement-jumps .mark")).to_have_text("Measured well")
    expect(page.locator("#measurement-files a")).to_have_text(["C3D", "CSV"])
    expect(page.locator("#other-where")).to_have_text(re.compile("^10 .* 0.000 s"))
    expect(page.locator("#compare-page")).to_have_attribute(
        "href", "./api/comparison.html?first=both&first_jump=1&second=one&second_jump=1&language=en"
    )
    page.goto(f"{panel.url}/#/recordings/one")
    expect(where).to_have_text(re.compile("^10 / 40"))
    expect(choice).to_be_hidden()


def test_a_jump_shows_what_the_start_list_had_and_where_it_goes_on(
    panel: Panel, service: MemoryService, open_page: Open
) -> None:
    folder = service.catalogue.directory
    session = {"athlete": "Anna Berg", "bib": "17", "round": "2", "club": "Lyn", "klasse": "J18", "recording": "one"}
    write_recording(folder, "one", (ALL_OK,) * 3, session)
    write_recording(folder, "one-part2", (ALL_OK,) * 3, session | {"continues": "one", "continues_after": "3"})
    page = open_page(f"{panel.url}/#/recordings/one", locale="nb-NO")
    facts = page.locator("#recording-facts")
    expect(facts).to_have_text(
        re.compile("Omgang2KlubbLynklasseJ18.*Lengde0,1\u202fs.*Navnone.*Fortsetter ione-part2$")
    )
    page.goto(f"{panel.url}/#/recordings/one-part2")
    expect(facts).to_have_text(re.compile("Navnone-part2.*Fortsetterone$"))


def test_a_stretch_that_is_marked_is_exported(
    panel: Panel, service: MemoryService, open_page: Open, tmp_path: Path
) -> None:
    write_recording(service.catalogue.directory, "jump", (ALL_OK,) * 30)
    page = open_page(f"{panel.url}/#/recordings/jump", width=360, height=780)
    where, mark = page.locator("#frame-where"), page.locator("#frame-strip em")
    expect(where).to_have_text(re.compile("^1 / 30"))
    expect(mark).to_be_hidden()
    for _ in range(4):
        page.locator("#frame-on").click()
    page.locator("#frame-more").click()
    page.locator("#mark-first").click()
    for _ in range(3):
        page.locator("#frame-on").click()
    page.locator("#mark-last").click()
    expect(page.locator("#export-first")).to_have_value("5")
    expect(page.locator("#export-last")).to_have_value("8")
    strip, marked = page.locator(".strip-lines").bounding_box(), mark.bounding_box()
    assert strip is not None
    assert marked is not None
    assert marked["x"] - strip["x"] == pytest.approx(strip["width"] * 4 / 30, abs=1)
    assert marked["width"] == pytest.approx(strip["width"] * 4 / 30, abs=1)
    page.locator("#export-last").fill("7")
    page.locator("#export-last").press("Tab")
    page.locator("#export-kind").select_option("csv")
    page.locator("#export-form button[type=submit]").click()
    with page.expect_download() as got:
        page.locator("#exports a").click()
    got.value.save_as(tmp_path / "tags.csv")
    rows = (tmp_path / "tags.csv").read_text().splitlines()
    assert [row.partition(",")[0] for row in rows[1:]] == ["5", "6", "7"]
    for _ in range(5):
        page.locator("#frame-back").click()
    page.locator("#mark-last").click()
    expect(page.locator("#export-last")).to_have_value("3")
    expect(page.locator("#export-first")).to_have_value("")
    page.locator("#mark-last").click()
    expect(mark).to_be_hidden()
    assert page.evaluate("document.documentElement.scrollWidth") == 360


def test_a_note_is_spoken_listened_to_and_removed(
    panel: Panel, service: MemoryService, client: httpx.Client, open_page: Open
) -> None:
    write_recording(service.catalogue.directory, "jump", (ALL_OK,) * 30)
    page = open_page(f"{panel.url}/#/recordings/jump", width=360, height=780)
    expect(page.locator("#frame-where")).to_have_text(re.compile("/ 30"))
    for _ in range(4):
        page.locator("#frame-on").click()
    page.locator("#frame-more").click()
    page.get_by_role("button", name="Voice note").click()
    expect(page.locator("#voice")).to_have_text(re.compile(r"Stop \([1-9] s\)"))
    page.locator("#voice").click()
    spoken = page.locator("#voices li")
    expect(spoken).to_have_count(1)
    expect(spoken.locator("b")).to_have_text("5")
    expect(page.locator("#voice")).to_have_text("Voice note")
    sound = spoken.locator("audio")
    sound.evaluate("audio => { void audio.play(); }")
    client.put("/api/recordings/jump/notes/3", json={"text": "somebody else's"}).raise_for_status()
    expect(page.locator("#notes li")).to_have_count(1)  # what others do does not end the listening
    wait_until(lambda: sound.evaluate("audio => audio.currentTime") > 0.2, "it can be heard")
    (note,) = service.voice_notes("jump")
    with av.open(str(service.catalogue.voice_notes("jump")[0].path)) as opened:
        assert opened.streams.audio[0].codec_context.name == "opus"
    assert note.pulse == 5
    assert page.evaluate("document.documentElement.scrollWidth") == 360
    page.get_by_role("button", name="Remove the spoken note at pulse 5").click()
    expect(spoken).to_have_count(0)
    assert service.voice_notes("jump") == []


def test_without_https_the_button_says_what_the_microphone_needs(
    panel: Panel, service: MemoryService, open_page: Open
) -> None:
    write_recording(service.catalogue.directory, "jump", (ALL_OK,) * 30)
    page = open_page("about:blank")
    page.add_init_script("Object.defineProperty(window, 'isSecureContext', { value: false });")
    page.goto(f"{panel.url}/#/recordings/jump")
    expect(page.locator("#frame-where")).to_have_text(re.compile("/ 30"))
    page.get_by_role("button", name="Voice note (needs HTTPS)").click()
    expect(page.locator("#snacks")).to_contain_text("svev certificate")
    with page.expect_popup() as opened:
        page.get_by_role("button", name="How to do it").click()
    expect(opened.value.locator("body")).to_contain_text("svev certificate --name NAME")


def test_the_focus_stays_on_a_recording_when_the_list_is_drawn_anew(
    panel: Panel, client: httpx.Client, jumps: None, open_page: Open
) -> None:
    page = open_page(panel.url)
    enter(page, panel, "recordings")
    link = page.get_by_role("link", name=re.compile("^17 "))
    link.focus()
    client.patch("/api/recordings/jump-1", json={"bib": "18"}).raise_for_status()
    link = page.get_by_role("link", name=re.compile("^18 "))
    expect(link).to_be_focused()

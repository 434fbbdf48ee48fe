"""The helper without a rig: what it refuses, its folders, and pictures that are taken back."""

import os
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import cv2
import numpy as np
import pytest

from analysis.targets.pattern import Layout
from rig.api.calibrating import CalibratingOrder, CalibratingState
from rig.errors import StateForbidsError
from rig.settings.camera import Region
from rig.transport.preview import PreviewSlot
from service.calibrating.folder import kept_pictures, next_number, numbers, picture_path, remove_last
from service.calibrating.helper import CalibrationHelper
from service.calibrating.look import Look
from tests.support.rigs import SIM
from tests.support.waiting import wait_until


@pytest.fixture
def slot() -> Iterator[PreviewSlot]:
    with closing(PreviewSlot.create(SIM.triplet_shape, len(SIM.cameras))) as made:
        yield made


def _helper(folder: Path, slot: PreviewSlot, kept: list[Path]) -> CalibrationHelper:
    return CalibrationHelper(folder, lambda: SIM, slot.fd, lambda: False, kept.append)


def _keep(pictures: Path, number: int, *cameras: str) -> None:
    for name in cameras:
        path = picture_path(pictures, name, number)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"picture")


def test_the_last_pulse_is_taken_back_in_all_cameras(tmp_path: Path) -> None:
    assert (numbers(tmp_path), next_number(tmp_path), remove_last(tmp_path)) == ([], 1, False)
    _keep(tmp_path, 1, "K1", "K2")
    _keep(tmp_path, 2, "K2")
    _keep(tmp_path, 3, "K1", "K2")
    (tmp_path / "K1" / ".003.png.new").write_bytes(b"")  # not whole yet
    assert next_number(tmp_path) == 4
    assert remove_last(tmp_path)
    assert [f"{path.parent.name}/{path.name}" for path in kept_pictures(tmp_path)] == [
        "K1/001.png", "K2/001.png", "K2/002.png",
    ]  # fmt: skip
    assert remove_last(tmp_path)
    assert numbers(tmp_path) == [1]


def test_kept_pictures_may_be_anything_in_a_folder_of_any_name(tmp_path: Path) -> None:
    """A folder that is no UTF-8, as on a stick; a pipe, a link, an empty file and none of a picture among the names."""
    folder = tmp_path / os.fsdecode(b"sted-\xe5")
    _keep(folder, 1, "K1", "K2")
    picture_path(folder, "K1", 1).write_bytes(cv2.imencode(".png", np.zeros((48, 64), np.uint8))[1].tobytes())
    os.mkfifo(picture_path(folder, "K1", 2))
    picture_path(folder, "K1", 3).symlink_to(picture_path(folder, "K1", 1))
    picture_path(folder, "K1", 4).touch()
    looking = Look(SIM, Layout(), folder)
    looking._remember()
    assert list(looking._kept) == [picture_path(folder, "K1", 1)]


def test_it_refuses_what_there_is_nothing_for(tmp_path: Path, slot: PreviewSlot) -> None:
    kept: list[Path] = []
    with closing(_helper(tmp_path, slot, kept)) as helper:
        assert helper.view().state is CalibratingState.OFF
        for call in (helper.undo, helper.compute, helper.save, helper.protocol):
            with pytest.raises(StateForbidsError, match=r"there (is|are) no"):
                call()
    assert (kept, list(tmp_path.iterdir())) == ([], [])


def test_pictures_go_on_unless_it_is_begun_anew_or_with_another_target(tmp_path: Path, slot: PreviewSlot) -> None:
    with closing(_helper(tmp_path, slot, [])) as helper:
        first = helper.begin(CalibratingOrder()).folder
        assert first is not None
        _keep(Path(first), 1, "K1")
        assert helper.end().state is CalibratingState.OFF
        again = helper.begin(CalibratingOrder())
        assert (again.folder, again.taken, again.state) == (first, 1, CalibratingState.LOOKING)
        other = helper.begin(CalibratingOrder(columns=11))
        assert (other.folder != first, other.taken) == (True, 0)
        assert helper.begin(CalibratingOrder(columns=11, anew=True)).folder not in {first, other.folder}


def test_pictures_go_on_after_a_restart_of_the_service(tmp_path: Path, slot: PreviewSlot) -> None:
    with closing(_helper(tmp_path, slot, [])) as helper:
        folder = helper.begin(CalibratingOrder(square_mm=60)).folder
    assert folder is not None
    _keep(Path(folder), 1, "K1")
    with closing(_helper(tmp_path, slot, [])) as again:
        assert (again.view().folder, again.view().taken) == (folder, 1)
        assert again.begin(CalibratingOrder(square_mm=60)).folder == folder
        other = again.begin(CalibratingOrder()).folder
        assert other not in {None, folder}
    with closing(_helper(tmp_path, slot, [])) as third:
        assert third.view().folder == other
    assert numbers(Path(folder)) == [1]


@pytest.mark.parametrize("result", ["calibration.json", "joined.json"])
def test_pictures_whose_calibration_the_rig_file_names_do_not_go_on(
    result: str, tmp_path: Path, slot: PreviewSlot
) -> None:
    with closing(_helper(tmp_path, slot, [])) as helper:
        folder = helper.begin(CalibratingOrder()).folder
    assert folder is not None
    rig = SIM.model_copy(update={"calibration": Path(folder).parent / result})
    with closing(CalibrationHelper(tmp_path, lambda: rig, slot.fd, lambda: False, lambda _: None)) as again:
        assert again.view().folder is None
        assert again.begin(CalibratingOrder()).folder != folder


def test_a_description_that_cannot_be_read_begins_another_set(tmp_path: Path, slot: PreviewSlot) -> None:
    with closing(_helper(tmp_path, slot, [])) as helper:
        folder = helper.begin(CalibratingOrder()).folder
    assert folder is not None
    (Path(folder).parent / "set.json").write_text('[{"columns": 1}, {}]')
    with closing(_helper(tmp_path, slot, [])) as again:
        assert again.begin(CalibratingOrder()).folder != folder


def test_what_is_in_the_rig_file_is_not_touched_and_other_regions_are_refused(
    tmp_path: Path, slot: PreviewSlot
) -> None:
    kept: list[Path] = []
    rigs = [SIM]
    with closing(CalibrationHelper(tmp_path, lambda: rigs[0], slot.fd, lambda: False, kept.append)) as helper:
        folder = helper.begin(CalibratingOrder()).folder
        assert folder is not None
        _keep(Path(folder), 1, "K1")
        helper.end()
        helper._change(state=CalibratingState.DONE)  # as after computing, which takes a minute
        first = SIM.cameras[0].model_copy(update={"region": Region(width=320, height=240)})
        rigs[0] = SIM.model_copy(update={"cameras": (first, *SIM.cameras[1:])})
        with pytest.raises(StateForbidsError, match="the region of K1 was changed"):
            helper.save()
        rigs[0] = SIM
        assert helper.save().saved
        assert kept == [Path(folder).parent / "calibration.json"]
        for call in (helper.undo, helper.compute):
            with pytest.raises(StateForbidsError, match="begin anew"):
                call()
        assert helper.begin(CalibratingOrder()).folder != folder


def test_pictures_that_no_calibration_comes_of_are_told(tmp_path: Path, slot: PreviewSlot) -> None:
    with closing(_helper(tmp_path, slot, [])) as helper:
        folder = helper.begin(CalibratingOrder()).folder
        assert folder is not None
        _keep(Path(folder), 1, "K1")
        helper.compute()
        wait_until(lambda: helper.view().state is CalibratingState.FAILED, "it has failed", 60, 0.05)
        problem = helper.view().problem
        assert problem is not None
        assert "no pictures in it" in problem.text
        assert helper.undo().state is CalibratingState.OFF
    assert os.fstat(slot.fd)

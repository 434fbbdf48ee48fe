"""The calibration helper: has pictures of a target taken while somebody moves it, then a calibration computed.

Both is done by programs that leave recorder and grabbers the processor, one at a time, and stand still while a
recording runs; the computing takes only what time nobody else wants. The helper ends when nobody has looked at it for a
while; the pictures stay.
"""

import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

from rig.api.calibrating import CalibratedLens, Calibrating, CalibratingOrder, CalibratingState, SeenTarget
from rig.api.statement import Statement
from rig.background.child import run_child
from rig.errors import StateForbidsError, StorageError
from rig.phrase import as_plain, phrase
from rig.settings.camera import Region
from rig.settings.model import RigSettings
from service.calibrating.folder import MOST, RESULT, PictureSet, last_set, new_set, numbers, remove_last
from service.calibrating.refusals import COMPUTING, IN_USE, NO_CALIBRATION, NO_PICTURE, NO_PICTURES, NO_PROTOCOL
from service.calibrating.said import lens, problem_in, seen

#: Without anybody who looks at it, the helper ends after so long a time.
_LEASE_S: Final = 60.0
_END_S: Final = 5.0
_FINDING: Final = "service.calibrating.finding"
_COMPUTING: Final = "service.calibrating.computing"


class CalibrationHelper:
    """Any thread may call any method.

    Args:
        directory: folder of the recordings.
        rig: gives the rig in use.
        live: descriptor of the memory with the newest triplet.
        busy: whether a recording runs.
        keep: puts a result file into rig file and logs.
    """

    def __init__(
        self,
        directory: Path,
        rig: Callable[[], RigSettings],
        live: int,
        busy: Callable[[], bool],
        keep: Callable[[Path], None],
    ) -> None:
        self._directory, self._rig, self._live, self._busy, self._keep = directory, rig, live, busy, keep
        self._lock, self._commands = threading.Lock(), threading.RLock()
        self._state, self._held = CalibratingState.OFF, False
        self._set = last_set(directory, rig().calibration)
        self._news: dict[str, Any] = {}
        self._problem: Statement | None = None
        self._lenses: tuple[CalibratedLens, ...] = ()
        self._saved = False
        self._worker: threading.Thread | None = None
        self._unwanted = threading.Event()
        self._looked = 0.0

    def view(self) -> Calibrating:
        """What the helper does and has; who asks keeps it going."""
        with self._lock:
            self._looked = time.monotonic()
            working = self._state in {CalibratingState.LOOKING, CalibratingState.COMPUTING}
            taken = [] if self._set is None else numbers(self._set.pictures)
            return Calibrating(
                state=CalibratingState.HELD if working and self._held else self._state,
                still=self._state is CalibratingState.LOOKING and bool(self._news.get("still")),
                full=len(taken) >= MOST,
                folder=None if self._set is None else str(self._set.pictures),
                taken=len(taken),
                cameras=() if self._set is None else self._seen(self._set.regions),
                problem=self._problem,
                lenses=self._lenses,
                saved=self._saved,
            )

    def begin(self, order: CalibratingOrder) -> Calibrating:
        """Look at live pictures and keep those that are wanted; pictures that are there go on, unless `anew`.

        Raises:
            StorageError: no folder can be made for them.
        """
        with self._commands:
            regions, known = self._regions(), self._set
            printed = order.model_copy(update={"anew": False})
            if known is not None and (known.order, known.regions) == (printed, regions):
                if self._state is CalibratingState.LOOKING and not order.anew:
                    return self.view()
            else:
                known = None
            self._end()
            with self._lock:
                if known is None or order.anew or self._saved:
                    known, self._news = new_set(self._directory, printed, regions), {}
                self._set, self._problem, self._lenses, self._saved = known, None, (), False
            self._start(CalibratingState.LOOKING, self._find)
            return self.view()

    def end(self) -> Calibrating:
        """Look no more, or give up computing; the pictures stay."""
        with self._commands:
            self._end()
            return self.view()

    def undo(self) -> Calibrating:
        """Remove the pictures that were kept last.

        Raises:
            StateForbidsError: there are none, or a calibration is being computed from them or is in use.
            StorageError: the disk refuses.
        """
        with self._commands:
            if self._state is CalibratingState.COMPUTING:
                raise StateForbidsError(COMPUTING)
            self._check_unsaved()
            try:
                if self._set is None or not remove_last(self._set.pictures):
                    raise StateForbidsError(NO_PICTURE)
            except OSError as error:
                raise StorageError(
                    phrase(
                        "calibrating_picture_stays",
                        "the picture cannot be removed ({why}): look at the disk",
                        why=str(error.strerror),
                    )
                ) from error
            with self._lock:
                if self._state in {CalibratingState.DONE, CalibratingState.FAILED}:
                    self._state, self._problem, self._lenses = CalibratingState.OFF, None, ()
            return self.view()

    def compute(self) -> Calibrating:
        """Compute a calibration from the pictures.

        Raises:
            StateForbidsError: there are no pictures, or the calibration by them is in use.
        """
        with self._commands:
            if self._state is CalibratingState.COMPUTING:
                return self.view()
            self._check_unsaved()
            if self._set is None or not numbers(self._set.pictures):
                raise StateForbidsError(NO_PICTURES)
            self._end()
            with self._lock:
                self._problem, self._lenses, self._saved = None, (), False
            self._start(CalibratingState.COMPUTING, self._compute)
            return self.view()

    def save(self) -> Calibrating:
        """Put the calibration into the rig file, and into all logs from now on.

        Raises:
            StateForbidsError: none is computed, a recording runs, or a region has been changed since.
            BadInputError: a camera has none.
            StorageError: the rig file cannot be written.
        """
        with self._commands:
            if self._state is not CalibratingState.DONE or self._set is None:
                raise StateForbidsError(NO_CALIBRATION)
            now = self._regions()
            changed = [name for name, region in self._set.regions.items() if now.get(name) != region]
            if changed:
                raise StateForbidsError(
                    phrase(
                        "calibrating_region",
                        "the region of {cameras} was changed since the pictures were taken: give it back, or "
                        "take pictures anew",
                        cameras=", ".join(changed),
                    )
                )
            self._keep(self._set.folder / RESULT)
            with self._lock:
                self._saved = True
            return self.view()

    def protocol(self) -> Path:
        """The protocol of the calibration.

        Raises:
            StateForbidsError: none is computed.
        """
        if self._state is not CalibratingState.DONE or self._set is None:
            raise StateForbidsError(NO_PROTOCOL)
        return self._set.folder / "protocol.html"

    def close(self) -> None:
        """End what runs."""
        with self._commands:
            self._end()

    def _regions(self) -> dict[str, Region]:
        return {camera.name: camera.region for camera in self._rig().cameras}

    def _check_unsaved(self) -> None:
        """Check that the rig file does not name what is computed from these pictures."""
        if self._saved:
            raise StateForbidsError(IN_USE)

    def _seen(self, regions: Mapping[str, Region]) -> tuple[SeenTarget, ...]:
        cameras, looking = self._news.get("cameras", {}), self._state is CalibratingState.LOOKING
        return tuple(seen(name, region, cameras.get(name), looking=looking) for name, region in regions.items())

    def _start(self, state: CalibratingState, work: Callable[[PictureSet], None]) -> None:
        if self._set is None:
            raise TypeError("there is no set of pictures")
        self._unwanted.clear()
        with self._lock:
            self._state, self._held, self._looked = state, False, time.monotonic()
        self._worker = threading.Thread(target=work, args=(self._set,), name="calibrating", daemon=True)
        self._worker.start()

    def _end(self) -> None:
        self._unwanted.set()
        if self._worker is not None:
            self._worker.join(_END_S)
            self._worker = None
        with self._lock:
            if self._state in {CalibratingState.LOOKING, CalibratingState.COMPUTING}:
                self._state = CalibratingState.OFF

    def _find(self, pictures: PictureSet) -> None:
        rig = self._rig()

        def wanted() -> bool:
            looked_at = time.monotonic() - self._looked < _LEASE_S
            return looked_at and self._regions() == pictures.regions and not self._unwanted.is_set()

        asked = {
            "fd": self._live,
            "rig": rig.model_dump(mode="json", exclude_unset=True),
            "folder": str(pictures.pictures),
            "layout": pictures.layout,
        }
        end = self._run(_FINDING, asked, wanted, inherited=(self._live,), yielding=False)
        self._conclude(CalibratingState.OFF, CalibratingState.LOOKING, end)

    def _compute(self, pictures: PictureSet) -> None:
        asked = {"folder": str(pictures.folder), "layout": pictures.layout}
        end = self._run(_COMPUTING, asked, lambda: not self._unwanted.is_set())
        if end is not None and "lenses" in end:
            with self._lock:
                self._lenses = tuple(lens(each) for each in end["lenses"])
        done = CalibratingState.FAILED if end is not None and "problem" in end else CalibratingState.DONE
        self._conclude(CalibratingState.OFF if end is None else done, CalibratingState.COMPUTING, end)

    def _run(
        self,
        module: str,
        asked: dict[str, Any],
        wanted: Callable[[], bool],
        *,
        inherited: tuple[int, ...] = (),
        yielding: bool = True,
    ) -> dict[str, Any] | None:
        def tell(news: dict[str, Any]) -> None:
            with self._lock:
                if news:
                    self._news = {**self._news, **news}
                    self._problem = problem_in(news)

        def hold(held: bool) -> None:
            with self._lock:
                self._held = held

        try:
            return run_child(
                module,
                asked,
                busy=self._busy,
                wanted=wanted,
                tell=tell,
                hold=hold,
                yielding=yielding,
                inherited=inherited,
            )
        except OSError as error:
            why = error.strerror or str(error)
            said = phrase("why_calibrating_ended", "the program that works on the pictures ended ({why})", why=why)
            return {"problem": as_plain(said)}

    def _conclude(self, now: CalibratingState, before: CalibratingState, end: dict[str, Any] | None) -> None:
        with self._lock:
            if self._state is before:
                self._state = now
                self._problem = problem_in(end or {})

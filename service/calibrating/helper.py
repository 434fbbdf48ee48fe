"""The calibration helper: has pictures of a target taken while somebody moves it, then a calibration computed.

Both is done by programs that leave recorder and grabbers the processor, one at a time, and stand still while a
recording runs; the computing takes only what time nobody else wants. The helper ends when nobody has looked at it for a
while; the pictures stay.
"""

import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from rig.api.calibrating import CalibratedLens, Calibrating, CalibratingOrder, CalibratingState, SeenTarget
from rig.api.statement import Statement
from rig.background.child import run_child
from rig.background.messages import End, Failed, Order
from rig.errors import StateForbidsError, StorageError
from rig.phrase import phrase
from rig.settings.camera import Region
from rig.settings.model import RigSettings
from service.calibrating.folder import MOST_PICTURES, RESULT, PictureSet, last_set, new_set, numbers, remove_last
from service.calibrating.messages import Compute, Computed, Find, Looked, as_error

#: Without anybody who looks at it, the helper ends after so long a time.
_LOOKED_AT_S: Final = 60.0
_PROGRAM_ENDS_S: Final = 5.0
_PROGRAM: Final = "service.calibrating.program"

#: Why something is refused.
_COMPUTING: Final = phrase(
    "calibrating_computing",
    "a calibration is being computed: wait until it is done, then take pictures away",
)
_NO_PICTURE: Final = phrase(
    "calibrating_no_picture",
    "there is no picture to take away: hold the target still before the cameras",
)
_NO_PICTURES: Final = phrase(
    "calibrating_no_pictures",
    "there are no pictures to compute from: hold the target before the cameras first",
)
_NO_CALIBRATION: Final = phrase(
    "calibrating_none",
    "there is no calibration yet: compute it, then put it into the rig file",
)
_NO_PROTOCOL: Final = phrase(
    "calibrating_no_protocol",
    "there is no protocol yet: compute the calibration first",
)
_IN_USE: Final = phrase(
    "calibrating_in_use",
    "the calibration by these pictures is in the rig file: begin anew for another one",
)


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
        self._seen = Looked()
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
                still=self._state is CalibratingState.LOOKING and self._seen.still,
                full=len(taken) >= MOST_PICTURES,
                folder=None if self._set is None else str(self._set.pictures),
                taken=len(taken),
                cameras=() if self._set is None else self._targets(self._set.regions),
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
                    known, self._seen = new_set(self._directory, printed, regions), Looked()
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
                raise StateForbidsError(_COMPUTING)
            self._check_unsaved()
            try:
                if self._set is None or not remove_last(self._set.pictures):
                    raise StateForbidsError(_NO_PICTURE)
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
                raise StateForbidsError(_NO_PICTURES)
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
                raise StateForbidsError(_NO_CALIBRATION)
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
            raise StateForbidsError(_NO_PROTOCOL)
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
            raise StateForbidsError(_IN_USE)

    def _targets(self, regions: Mapping[str, Region]) -> tuple[SeenTarget, ...]:
        """What the cameras have seen; corners count while the helper is looking."""
        seen = self._seen.cameras or {}
        nothing = {} if self._state is CalibratingState.LOOKING else {"corners": ()}
        return tuple(
            seen[name].model_copy(update=nothing)
            if name in seen
            else SeenTarget(camera=name, width=region.width, height=region.height)
            for name, region in regions.items()
        )

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
            self._worker.join(_PROGRAM_ENDS_S)
            self._worker = None
        with self._lock:
            if self._state in {CalibratingState.LOOKING, CalibratingState.COMPUTING}:
                self._state = CalibratingState.OFF

    def _find(self, pictures: PictureSet) -> None:
        def wanted() -> bool:
            looked_at = time.monotonic() - self._looked < _LOOKED_AT_S
            return looked_at and self._regions() == pictures.regions and not self._unwanted.is_set()

        order = Find(fd=self._live, rig=self._rig(), folder=pictures.pictures, printed=pictures.order)
        end = self._run(order, wanted, yielding=False)
        self._conclude(CalibratingState.OFF, CalibratingState.LOOKING, end)

    def _compute(self, pictures: PictureSet) -> None:
        order = Compute(folder=pictures.folder, printed=pictures.order)
        end = self._run(order, lambda: not self._unwanted.is_set())
        if isinstance(end, Computed):
            with self._lock:
                self._lenses = end.lenses
        done = CalibratingState.FAILED if isinstance(end, Failed) else CalibratingState.DONE
        self._conclude(CalibratingState.OFF if end is None else done, CalibratingState.COMPUTING, end)

    def _run(self, order: Order, wanted: Callable[[], bool], *, yielding: bool = True) -> End | None:
        def tell(news: Looked) -> None:
            with self._lock:
                self._problem = news.problem
                if news.cameras is not None:
                    self._seen = news

        def hold(held: bool) -> None:
            with self._lock:
                self._held = held

        try:
            return run_child(
                _PROGRAM, order, Looked | Computed,
                busy=self._busy, wanted=wanted, tell=tell, hold=hold, yielding=yielding, inherited=(self._live,),
            )  # fmt: skip
        except OSError as error:
            why = error.strerror or str(error)
            said = phrase("why_calibrating_ended", "the program that works on the pictures ended ({why})", why=why)
            return Failed(said=said)

    def _conclude(self, now: CalibratingState, before: CalibratingState, end: End | None) -> None:
        with self._lock:
            if self._state is before:
                self._state = now
                self._problem = as_error(end.said) if isinstance(end, Failed) else None

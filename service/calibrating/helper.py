"""The calibration helper: has pictures of a target taken while somebody moves it, then a calibration computed.

Both is done by programs that leave recorder and grabbers the processor, one at a time, and stand still while a
recording runs; the computing takes only what time nobody else wants. The helper ends when nobody has looked at it for a
while; the pictures stay.
"""

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

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


@dataclass(frozen=True, slots=True)
class _Situation:
    """What the helper does and has.

    Attributes:
        state: what it does; while it is `held`, it waits for the end of a recording.
        held: whether its program stands still.
        pictures: the set that is worked on; None: there is none yet.
        seen: what the last pictures show.
        problem: why nothing is found or computed.
        lenses: the calibration, once it is computed.
        saved: whether the rig file names it.
    """

    pictures: PictureSet | None
    state: CalibratingState = CalibratingState.OFF
    held: bool = False
    seen: Looked = field(default_factory=Looked)
    problem: Statement | None = None
    lenses: tuple[CalibratedLens, ...] = ()
    saved: bool = False

    @property
    def works(self) -> bool:
        """Whether a program runs."""
        return self.state in {CalibratingState.LOOKING, CalibratingState.COMPUTING}

    def view(self) -> Calibrating:
        """As the REST API tells it; the kept pictures on the disk are what counts."""
        taken = [] if self.pictures is None else numbers(self.pictures.pictures)
        return Calibrating(
            state=CalibratingState.HELD if self.works and self.held else self.state,
            still=self.state is CalibratingState.LOOKING and self.seen.still,
            full=len(taken) >= MOST_PICTURES,
            folder=None if self.pictures is None else str(self.pictures.pictures),
            printed=None if self.pictures is None else self.pictures.order,
            taken=len(taken),
            cameras=() if self.pictures is None else self._targets(self.pictures.regions),
            problem=self.problem,
            lenses=self.lenses,
            saved=self.saved,
        )

    def _targets(self, regions: Mapping[str, Region]) -> tuple[SeenTarget, ...]:
        """What the cameras have seen; corners count while the helper is looking."""
        seen = self.seen.cameras or {}
        nothing = {} if self.state is CalibratingState.LOOKING else {"corners": ()}
        return tuple(
            seen[name].model_copy(update=nothing)
            if name in seen
            else SeenTarget(camera=name, width=region.width, height=region.height)
            for name, region in regions.items()
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
        self._now = _Situation(last_set(directory, rig().calibration))
        self._worker: threading.Thread | None = None
        self._unwanted = threading.Event()
        self._looked = 0.0

    def view(self) -> Calibrating:
        """What the helper does and has; who asks keeps it going."""
        self._looked = time.monotonic()
        return self._now.view()

    def begin(self, order: CalibratingOrder) -> Calibrating:
        """Look at live pictures and keep those that are wanted; pictures that are there go on, unless `anew`.

        Raises:
            StorageError: no folder can be made for them.
        """
        with self._commands:
            regions, known = self._regions(), self._now.pictures
            printed = order.model_copy(update={"anew": False})
            if known is not None and (known.order, known.regions) == (printed, regions):
                if self._now.state is CalibratingState.LOOKING and not order.anew:
                    return self.view()
            else:
                known = None
            self._end()
            if known is None or order.anew or self._now.saved:
                known = new_set(self._directory, printed, regions)
                self._change(seen=Looked())
            self._start(CalibratingState.LOOKING, self._find, known)
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
            if self._now.state is CalibratingState.COMPUTING:
                raise StateForbidsError(_COMPUTING)
            self._check_unsaved()
            try:
                if self._now.pictures is None or not remove_last(self._now.pictures.pictures):
                    raise StateForbidsError(_NO_PICTURE)
            except OSError as error:
                raise StorageError(
                    phrase(
                        "calibrating_picture_stays",
                        "the picture cannot be removed ({why}): look at the disk",
                        why=str(error.strerror),
                    )
                ) from error
            if self._now.state in {CalibratingState.DONE, CalibratingState.FAILED}:
                self._change(state=CalibratingState.OFF, problem=None, lenses=())
            return self.view()

    def compute(self) -> Calibrating:
        """Compute a calibration from the pictures.

        Raises:
            StateForbidsError: there are no pictures, or the calibration by them is in use.
        """
        with self._commands:
            if self._now.state is CalibratingState.COMPUTING:
                return self.view()
            self._check_unsaved()
            pictures = self._now.pictures
            if pictures is None or not numbers(pictures.pictures):
                raise StateForbidsError(_NO_PICTURES)
            self._end()
            self._start(CalibratingState.COMPUTING, self._compute, pictures)
            return self.view()

    def save(self) -> Calibrating:
        """Put the calibration into the rig file, and into all logs from now on.

        Raises:
            StateForbidsError: none is computed, a recording runs, or a region has been changed since.
            BadInputError: a camera has none.
            StorageError: the rig file cannot be written.
        """
        with self._commands:
            pictures = self._now.pictures
            if self._now.state is not CalibratingState.DONE or pictures is None:
                raise StateForbidsError(_NO_CALIBRATION)
            regions = self._regions()
            changed = [name for name, region in pictures.regions.items() if regions.get(name) != region]
            if changed:
                raise StateForbidsError(
                    phrase(
                        "calibrating_region",
                        "the region of {cameras} was changed since the pictures were taken: give it back, or "
                        "take pictures anew",
                        cameras=", ".join(changed),
                    )
                )
            self._keep(pictures.folder / RESULT)
            self._change(saved=True)
            return self.view()

    def protocol(self) -> Path:
        """The protocol of the calibration.

        Raises:
            StateForbidsError: none is computed.
        """
        now = self._now
        if now.state is not CalibratingState.DONE or now.pictures is None:
            raise StateForbidsError(_NO_PROTOCOL)
        return now.pictures.folder / "protocol.html"

    def close(self) -> None:
        """End what runs."""
        with self._commands:
            self._end()

    def _regions(self) -> dict[str, Region]:
        return {camera.name: camera.region for camera in self._rig().cameras}

    def _check_unsaved(self) -> None:
        """Check that the rig file does not name what is computed from these pictures."""
        if self._now.saved:
            raise StateForbidsError(_IN_USE)

    def _change(self, **what: Any) -> None:
        with self._lock:
            self._now = replace(self._now, **what)

    def _start(self, state: CalibratingState, work: Callable[[PictureSet], None], pictures: PictureSet) -> None:
        self._unwanted.clear()
        self._looked = time.monotonic()
        self._change(pictures=pictures, state=state, held=False, problem=None, lenses=(), saved=False)
        self._worker = threading.Thread(target=work, args=(pictures,), name="calibrating", daemon=True)
        self._worker.start()

    def _end(self) -> None:
        self._unwanted.set()
        if self._worker is not None:
            self._worker.join(_PROGRAM_ENDS_S)
            self._worker = None
        if self._now.works:
            self._change(state=CalibratingState.OFF)

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
            self._change(lenses=end.lenses)
        done = CalibratingState.FAILED if isinstance(end, Failed) else CalibratingState.DONE
        self._conclude(CalibratingState.OFF if end is None else done, CalibratingState.COMPUTING, end)

    def _run(self, order: Order, wanted: Callable[[], bool], *, yielding: bool = True) -> End | None:
        def tell(news: Looked) -> None:
            self._change(problem=news.problem, **({} if news.cameras is None else {"seen": news}))

        try:
            return run_child(
                _PROGRAM, order, Looked | Computed,
                busy=self._busy, wanted=wanted, tell=tell, hold=lambda held: self._change(held=held), yielding=yielding,
                inherited=(self._live,),
            )  # fmt: skip
        except OSError as error:
            why = error.strerror or str(error)
            said = phrase("why_calibrating_ended", "the program that works on the pictures ended ({why})", why=why)
            return Failed(said=said)

    def _conclude(self, now: CalibratingState, before: CalibratingState, end: End | None) -> None:
        with self._lock:
            if self._now.state is before:
                problem = as_error(end.said) if isinstance(end, Failed) else None
                self._now = replace(self._now, state=now, problem=problem)

"""Long work that several people ask for."""

from rig.background.errands import Errands


def test_nothing_begins_once_all_is_closed() -> None:
    asked: list[str] = []
    errands = Errands(
        "tests.rig.background.starting_program",
        "nothing",
        None,
        heard=lambda state, _: state,
        done=lambda *_: "done",
        failed=lambda *_: "failed",
    )
    errands.close()
    assert errands.begin("Anna", "working", lambda: asked.append("Anna")) == "nothing"
    assert not errands.works("Anna")
    assert asked == []

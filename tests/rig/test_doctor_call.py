"""Messages that send to the doctor name the rig file in use."""

from pathlib import Path

from rig.doctor_call import doctor_call, rig_in_use, with_rig_in_use


def test_the_rig_in_use_stands_in_the_command(tmp_path: Path) -> None:
    assert doctor_call() == "svev doctor"
    with rig_in_use(tmp_path / "my rig.toml"), rig_in_use(None):
        assert doctor_call() == f"svev doctor --rig '{tmp_path}/my rig.toml'"
        assert with_rig_in_use("then run: svev doctor") == f"then run: {doctor_call()}"
        assert with_rig_in_use("run svev doctor --find") == "run svev doctor --find"
    assert doctor_call() == "svev doctor"

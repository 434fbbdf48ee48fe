"""Whatever the package of an object store raises is an OSError of one line."""

from pathlib import Path

import pytest

from rig.errors import BadInputError
from rig.host.object_store import object_store, why_not


def test_an_error_of_another_package_is_an_os_error(tmp_path: Path) -> None:
    with pytest.raises(OSError) as raised, object_store(str(tmp_path), {}):  # noqa: PT011 - any
        raise RuntimeError("the store went away\n<html>")
    assert why_not(raised.value) == "the store went away"
    with pytest.raises(OSError) as raised, object_store(str(tmp_path), {}):  # noqa: PT011 - any
        raise RuntimeError
    assert why_not(raised.value) == "RuntimeError"


def test_errors_of_ours_and_of_the_system_stay_what_they_are(tmp_path: Path) -> None:
    with pytest.raises(BadInputError, match="ours"), object_store(str(tmp_path), {}):
        raise BadInputError("ours")
    with pytest.raises(FileNotFoundError), object_store(str(tmp_path), {}) as (store, path):
        store.info(f"{path}/nothing")


def test_an_address_of_an_unknown_kind_is_said_to_be() -> None:
    with pytest.raises(OSError, match="Protocol not known: nope"), object_store("nope://hill", {}):
        pass

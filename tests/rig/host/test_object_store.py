"""Whatever the package of an object store raises is an OSError of one line; one that is silent is given up."""

import os
import socket
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Final

import pytest

from rig.errors import BadInputError
from rig.host.object_store import object_store, why_not
from tests.support.object_store import KEYS

#: In a process of its own: the libraries keep threads and connections.
_ASKED: Final = """
import sys
from rig.host import object_store
object_store._ANSWER_S = 1
try:
    with object_store.object_store("s3://hill/day", {"endpoint_url": sys.argv[1]}) as (store, path):
        store.pipe_file(path, b"one")
except object_store.StoreSilentError as error:
    print(error)
"""


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


def test_a_store_that_never_answers_is_given_up_after_four_tries_and_named() -> None:
    with socket.create_server(("127.0.0.1", 0), backlog=64) as silent:  # the kernel takes the connections
        address = f"http://127.0.0.1:{silent.getsockname()[1]}"
        command = [sys.executable, "-c", _ASKED, address]
        done = subprocess.run(command, env=os.environ | KEYS, capture_output=True, text=True, timeout=120, check=False)
        silent.setblocking(False)
        tries = 0
        with suppress(BlockingIOError):
            while True:
                silent.accept()[0].close()
                tries += 1
    assert (done.stdout, done.stderr) == (f"the object store at {address} does not answer\n", "")
    assert tries == 4

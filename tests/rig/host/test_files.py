"""Files and folders that are something else than their name promises."""

import os
import socket
from pathlib import Path

import pytest

from rig.host.disk import replace_file
from rig.host.files import UntrustedFileError, make_folder, open_regular, opened_folder, read_own, read_whole


def test_a_file_is_read_up_to_the_limit_and_refused_above_it(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"x" * 1024)
    assert read_whole(path, 1024, links=False) == b"x" * 1024
    with pytest.raises(UntrustedFileError, match="is larger than 0 KiB"):
        read_whole(path, 1023, links=False)
    os.truncate(path, 1 << 40)
    with pytest.raises(UntrustedFileError, match="is larger than 1 MB"):
        read_whole(path, 1_000_000, links=False)


@pytest.mark.timeout(20)
def test_nobody_waits_for_what_is_no_file(tmp_path: Path, short_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(short_path / "s"))
        for path in (tmp_path / "pipe", short_path / "s", Path("/dev/zero")):
            with pytest.raises(UntrustedFileError, match="is no file, but a device or a pipe"):
                read_whole(path, 10, links=True)
    with pytest.raises(UntrustedFileError, match="is a folder"):
        read_whole(tmp_path, 10, links=True)
    with pytest.raises(FileNotFoundError):
        read_whole(tmp_path / "none", 10, links=True)


def test_a_link_is_followed_only_where_a_person_has_named_it(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"x")
    (tmp_path / "link").symlink_to("file")
    assert read_whole(tmp_path / "link", 10, links=True) == b"x"
    with pytest.raises(UntrustedFileError, match="links are not followed"):
        open_regular(tmp_path / "link", links=False)


def test_an_own_file_is_one_that_nobody_else_can_have_written(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"x")
    path.chmod(0o644)
    assert read_own(path, 10) == b"x"
    path.chmod(0o666)
    with pytest.raises(UntrustedFileError, match="others may have written it"):
        read_own(path, 10)


def test_a_folder_is_no_link_and_no_pipe(tmp_path: Path) -> None:
    make_folder(tmp_path / "folder")
    make_folder(tmp_path / "folder")
    with opened_folder(tmp_path / "folder") as descriptor:
        assert os.fstat(descriptor).st_ino == (tmp_path / "folder").stat().st_ino
    (tmp_path / "link").symlink_to("folder")
    os.mkfifo(tmp_path / "pipe")
    for name, text in (("link", "links are not followed"), ("pipe", "is no folder")):
        with pytest.raises(UntrustedFileError, match=text), opened_folder(tmp_path / name):
            pass
        with pytest.raises(UntrustedFileError, match=text):
            make_folder(tmp_path / name)


def test_a_renewed_file_takes_the_place_of_a_link_that_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").write_text("dear")
    for links, elsewhere in ((False, "dear"), (True, "new")):
        (tmp_path / "link").unlink(missing_ok=True)
        (tmp_path / "link").symlink_to("elsewhere")
        replace_file(tmp_path / "link", b"new", links=links)
        assert ((tmp_path / "link").read_text(), (tmp_path / "elsewhere").read_text()) == ("new", elsewhere)
        assert (tmp_path / "link").is_symlink() == links

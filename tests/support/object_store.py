"""An object store on loopback: a real S3 server (moto), reached through fsspec by programs of their own."""

import json
import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from tests.support.loopback import Loopback
from tests.support.waiting import wait_until

#: In a process of its own, as a workplace would use it: the libraries keep threads and connections.
_PROGRAM: Final = """
import json, sys, fsspec
address, what, bucket, *more = sys.argv[1:]
store = fsspec.filesystem("s3", endpoint_url=address)
if what == "put":
    if bucket.partition("/")[0] not in [name.rstrip("/") for name in store.ls("")]:
        store.mkdir(bucket.partition("/")[0])
    for path in more:
        store.put_file(path, bucket + "/" + path.rsplit("/", 1)[1])
elif what == "keep-all":
    store.call_s3("put_bucket_versioning", Bucket=bucket, VersioningConfiguration={"Status": "Enabled"})
elif what == "versions":
    answer = store.call_s3("list_object_versions", Bucket=bucket)
    assert not answer["IsTruncated"]
    print(json.dumps([[each["Key"], each["VersionId"]] for each in answer.get("Versions", ())]))
else:
    store.get(bucket + "/", more[0], recursive=True)
"""
#: No secrets.
KEYS: Final = {"AWS_ACCESS_KEY_ID": "test", "AWS_SECRET_ACCESS_KEY": "test", "AWS_DEFAULT_REGION": "us-east-1"}


@contextmanager
def object_store(loopback: Loopback) -> Iterator[str]:
    """An S3 server; gives its address."""
    port = loopback.free_port()
    command = [sys.executable, "-m", "moto.server", "-H", loopback.host, "-p", str(port)]
    # It tells each request: a pipe that nobody reads would stop it after some hundreds.
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        try:
            wait_until(lambda: process.poll() is not None or _listens(loopback.host, port), "the store answers")
            assert process.poll() is None, "the store has ended"
            yield f"http://{loopback.host}:{port}"
        finally:
            process.kill()


def _listens(host: str, port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex((host, port)) == 0


def put(address: str, place: str, *paths: str) -> None:
    """Put files into a bucket, which is made if there is none; `place`: bucket, or bucket/folder."""
    _run(address, "put", place, *paths)


def take(address: str, place: str, folder: str) -> None:
    """Take everything out of a bucket, or a folder in it."""
    _run(address, "take", place, folder)


def keep_all(address: str, bucket: str) -> None:
    """Let a bucket keep every version of an object from now on."""
    _run(address, "keep-all", bucket)


def versions(address: str, bucket: str) -> dict[str, tuple[str, ...]]:
    """The versions of each object of a bucket that keeps them all."""
    found: dict[str, tuple[str, ...]] = {}
    for name, version in json.loads(_run(address, "versions", bucket)):
        found[name] = *found.get(name, ()), version
    return found


def _run(address: str, *arguments: str) -> str:
    command = [sys.executable, "-c", _PROGRAM, address, *arguments]
    done = subprocess.run(command, env=os.environ | KEYS, timeout=60, check=True, stdout=subprocess.PIPE, text=True)
    return done.stdout

"""Started by test_child: computes until it is ended, and tells nobody how far it is; or says its pid and ends."""

import os
from typing import Any

from rig.background.program import Teller, serve


def _work(asked: dict[str, Any], tell: Teller) -> dict[str, Any]:
    tell(last=True, pid=os.getpid())
    while asked["long"]:
        pass
    return {"done": True}


if __name__ == "__main__":
    serve(_work)

"""A program that tells what it is, or ends in the way that its argument names."""

import atexit
import os
import signal
import sys
import threading
import time
from pathlib import Path


def _say(text: object) -> None:
    sys.stdout.write(f"{text}\n")


def _is_open(number: int) -> bool:
    try:
        os.fstat(number)
    except OSError:
        return False
    return True


def _leave() -> None:
    """End with a thread that still runs, something registered, and what is not written yet."""

    def go_on() -> None:
        threading.main_thread().join()
        _say("the thread has ended")

    atexit.register(_say, "what was registered")
    threading.Thread(target=go_on).start()
    _say("main has ended")
    sys.exit("a text instead of a code")


def main() -> None:
    """Do what the argument says."""
    match sys.argv[1]:
        case "facts":
            _say(f"parent={os.getppid()}")
            _say(f"shown={[word.decode() for word in Path('/proc/self/cmdline').read_bytes().split(bytes(1)) if word]}")
            _say(f"argv={sys.argv[1:]}")
            _say(f"folder={Path.cwd()}")
            _say(f"group={os.getpgrp()}")
            _say(f"ignores Ctrl-C={signal.getsignal(signal.SIGINT) is signal.SIG_IGN}")
            _say(f"threads={len(list(Path('/proc/self/task').iterdir()))}")
        case "descriptors":
            inherited = int(sys.argv[2])
            os.write(inherited, b"here")
            _say([number for number in range(100) if _is_open(number)])
        case "environment":
            _say(
                sorted(
                    (name, value) for name, value in os.environ.items() if name in {"SVEV_TEST_NOW", "SVEV_TEST_OWN"}
                )
            )
        case "ends":
            sys.exit(7)
        case "ends well":
            sys.stdout.write("well")  # and it is not written yet
        case "leaves":
            _leave()
        case "fails":
            _say(1 // 0)
        case "killed":
            os.kill(os.getpid(), signal.SIGKILL)
        case "sleeps":
            time.sleep(60)


if __name__ == "__main__":
    main()

"""A program that tells what it is, or ends in the way that its argument names."""

import os
import signal
import sys
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
        case "fails":
            _say(1 // 0)
        case "killed":
            os.kill(os.getpid(), signal.SIGKILL)
        case "sleeps":
            time.sleep(60)


if __name__ == "__main__":
    main()

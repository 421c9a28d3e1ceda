"""``python -m vgps`` is ``vgps``: the command line, from its first import on interruptible in one line."""

import errno
import os
import signal
import sys
from types import FrameType

_BAD_INPUT, _INTERRUPTED, _TERMINATED = 2, 130, 143
_DISK = {errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EFBIG, errno.EIO}


def main() -> None:
    """Run the command line; Ctrl-C and SIGTERM remove what is half-written and give one line."""
    status = _INTERRUPTED

    def terminate(_: int, __: FrameType | None) -> None:
        nonlocal status
        status = _TERMINATED
        raise KeyboardInterrupt

    try:
        signal.signal(signal.SIGTERM, terminate)
        from vgps.cli import main as run  # noqa: PLC0415  (a moment in which Ctrl-C is as likely)

        run()
    except KeyboardInterrupt:
        _end("vgps: interrupted, nothing written", status)
    except BrokenPipeError:
        _end("", 0)  # whoever read the output has seen enough
    except OSError as error:
        if error.errno not in _DISK:
            raise
        where = f"{error.filename}: " if error.filename else ""
        _end(
            f"vgps: {where}cannot be written ({error.strerror}); check free space and permissions", _BAD_INPUT
        )


def _end(line: str, status: int) -> None:
    """End at once: threads that still work on a picture must not keep the process."""
    if line:
        print(line, file=sys.stderr, flush=True)
    os._exit(status)


if __name__ == "__main__":
    main()

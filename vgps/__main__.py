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
    status = 0

    def stop(number: int, _: FrameType | None) -> None:
        nonlocal status
        status = _TERMINATED if number == signal.SIGTERM else _INTERRUPTED
        raise KeyboardInterrupt

    try:
        signal.signal(signal.SIGTERM, stop)
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # else it is ignored, as by nohup
            signal.signal(signal.SIGINT, stop)
        from vgps.cli import main as run  # noqa: PLC0415  (a moment in which Ctrl-C is as likely)

        run()
    except KeyboardInterrupt:
        _end("vgps: interrupted, nothing written", status or _INTERRUPTED)
    except BrokenPipeError:
        _end("", 0)  # whoever read the output has seen enough
    except Exception as error:
        if status:  # compiled modules turn an interrupted import into an ImportError
            _end("vgps: interrupted, nothing written", status)
        if not isinstance(error, OSError) or error.errno not in _DISK:
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

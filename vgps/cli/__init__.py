"""The command line: arguments only; each verb calls a function that scripts can call too.

Exit codes: 0 done, 2 bad input (one line on standard error), 1 a fault of the program.
"""

import sys

import cyclopts
from pydantic import ValidationError

from vgps.cli import (  # noqa: F401  (importing a module registers its verb)
    calibrate,
    compare,
    config,
    demo,
    evaluate,
    export,
    inspect,
    landmarks,
    online,
    report,
    simulate,
    smooth,
    survey,
    track,
)
from vgps.cli.app import app
from vgps.errors import VgpsError

_BAD_INPUT, _INTERRUPTED = 2, 130


def main() -> None:
    """Run a verb; a user's mistake gives one line and exit code 2."""
    try:
        app(sys.argv[1:], exit_on_error=False, print_error=False)
    except (VgpsError, cyclopts.CycloptsError) as error:
        print("vgps: " + " ".join(_message(error).split()), file=sys.stderr)
        sys.exit(_BAD_INPUT)
    except KeyboardInterrupt:
        print("vgps: interrupted, nothing written", file=sys.stderr)
        sys.exit(_INTERRUPTED)


def _message(error: Exception) -> str:
    cause = error.__cause__
    if not (isinstance(error, cyclopts.CycloptsError) and isinstance(cause, ValidationError)):
        return str(error)  # pydantic's own text is long and names no option
    first = cause.errors()[0]
    option = "--" + "-".join(str(part) for part in first["loc"]).replace("_", "-")
    return f"Invalid value {first['input']!r} for {option}. {first['msg']}."

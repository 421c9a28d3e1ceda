"""The command line: arguments only; each verb calls a function that scripts can call too.

Exit codes: 0 done, 2 bad input (one line on standard error), 1 a fault of the program.
"""

import sys

import cyclopts
from pydantic import ValidationError

from vgps.cli.app import app
from vgps.errors import VgpsError

# imported when it is called: nobody waits for what another verb needs
_VERBS = (
    "demo:demo", "smooth:smooth", "online:online", "evaluate:evaluate", "report:report", "inspect:inspect",
    "export:export", "survey:survey", "compare:compare", "join:join", "landmarks:landmarks", "track:track",
    "calibrate:calibrate_gyro", "calibrate:calibrate_imu",
    "calibrate:calibrate_camera", "simulate:simulate", "config:config", "doctor:doctor",
)  # fmt: skip
for _verb in _VERBS:
    app.command(f"vgps.cli.{_verb}")

_BAD_INPUT = 2


def main() -> None:
    """Run a verb; a user's mistake gives one line and exit code 2."""
    if sys.argv[1:2] in ([], ["--help"], ["-h"]):
        for verb in list(app):
            app[verb]  # the list of verbs has the first line of each
    try:
        app(sys.argv[1:], exit_on_error=False, print_error=False)
    except (VgpsError, cyclopts.CycloptsError) as error:
        print("vgps: " + " ".join(_message(error).split()), file=sys.stderr)
        sys.exit(_BAD_INPUT)


def _message(error: Exception) -> str:
    cause = error.__cause__
    if isinstance(error, cyclopts.CycloptsError) and error.command_chain and not cause:
        verb = " ".join(error.command_chain)
        text = str(error).removesuffix(".")
        if isinstance(error, cyclopts.MissingArgumentError) and error.argument is not None:
            text = text.replace(f'Command "{verb}" parameter {error.argument.name} requires an argument', "")
            text = f"{error.argument.name} is missing{text}"
        return f"{text}; see vgps {verb} --help"
    if not (isinstance(error, cyclopts.CycloptsError) and isinstance(cause, ValidationError)):
        return str(error)  # pydantic's own text is long and names no option
    first = cause.errors()[0]
    option = "--" + "-".join(str(part) for part in first["loc"]).replace("_", "-")
    return f"Invalid value {first['input']!r} for {option}. {first['msg']}."

"""The verb ``doctor``."""

import sys

from rich.console import Console
from rich.table import Table
from rich.text import Text

from vgps.cli.app import print_line


def doctor() -> None:
    """Print versions, codecs, cores and memory, and what is missing; exit with code 2 if something is."""
    from vgps.runtime.doctor import examine

    findings = examine()
    table = Table("", "here")
    for finding in findings:
        table.add_row(Text(finding.name), Text(finding.state, "red" if finding.remedy else ""))
    Console().print(table)
    missing = [finding for finding in findings if finding.remedy]
    for finding in missing:
        print_line(f"{finding.name}: {finding.remedy}", to_stderr=True)
    print_line("something is missing, see above" if missing else "all that vgps needs is here")
    if missing:
        sys.exit(2)

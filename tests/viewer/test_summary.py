"""The run in words, read back from a saved recording."""

from dataclasses import replace

from reading_back import Logged

from vgps.solution import Solution
from vgps.viewer.summary import summary


def test_the_summary_states_counts_costs_and_warnings(logged: Logged) -> None:
    ((text,),) = logged.rows("/summary", "TextDocument:text")
    for words in (
        "6 frames, 3 landmarks, 18 observations",
        "2 used, 1 down-classed, 1 rejected, 1 not used",
        "| video | 10 | 2 |",
        "- the roll is uncertain",
        "\nPart of the picture does not move with the scene",
        "\nPart of the picture moves on its own",
    ):
        assert words in text


def test_a_run_without_warnings_and_gps(solution: Solution) -> None:
    text = summary(replace(solution, warnings=(), gps=None, fixes=None))
    assert "fixes: no GPS." in text and "### Warnings\n- none" in text
    assert "- no ffmpeg" in summary(solution, ("no ffmpeg",))

"""The run in words: counts, energies, warnings and the meaning of the colours."""

import numpy as np
import rerun as rr

from vgps.evaluation.left_out import left_out_sentences
from vgps.solution import Solution, Verdict
from vgps.viewer import colours
from vgps.viewer.run_stream import RunStream

SUMMARY = "summary"


def log_summary(stream: RunStream, solution: Solution, notes: tuple[str, ...]) -> None:
    """Log the summary; ``notes`` say what could not be shown."""
    stream.log_static(SUMMARY, rr.TextDocument(summary(solution, notes), media_type="text/markdown"))


def summary(solution: Solution, notes: tuple[str, ...] = ()) -> str:
    """Return the run in Markdown."""
    report, table = solution.report, solution.fixes
    terms = [
        f"| {term} | {report.cost_before[term]:.6g} | {report.cost_after.get(term, np.nan):.6g} |"
        for term in report.cost_before
    ]
    verdicts = "no GPS" if table is None else ", ".join(f"{table.verdict.count(v)} {v}" for v in Verdict)
    warnings = [f"- {line}" for line in (*solution.warnings, *notes)] or ["- none"]
    return "\n".join(
        [
            f"## {solution.recording or 'Run'}",
            f"{len(solution.t_s)} frames, {len(solution.landmarks.sigma_px)} landmarks, "
            f"{len(solution.observations.frame)} observations; fixes: {verdicts}.",
            *(f"{sentence[0].upper()}{sentence[1:]}." for sentence in left_out_sentences(solution)),
            "",
            "### Warnings",
            *warnings,
            "",
            "### Final optimisation (stage D)",
            "| term of the cost | before | after |",
            "|---|---|---|",
            *terms,
            "",
            f"{report.iterations} iterations; {report.stop_reason}.",
            "",
            "### Colours",
            "- path: blue; bridged frames: orange; path before stage D: violet",
            f"- features: green at a reprojection error of 0 px to red from {colours.BAD_PX:g} px; "
            "white dots: the reprojected landmarks",
            "- red rectangles in the video: what never moves (a bonnet, text, a reflection), left out; "
            "orange ones: what moves on its own, left out",
            f"- landmarks: green at sigma_j = {colours.GOOD_SIGMA_PX:g} px to "
            f"red from {colours.BAD_SIGMA_PX:g} px",
            "- used fixes: rtk_fix green, rtk_float yellow, ppp teal, dgps blue, sbas violet, single pink; "
            "other fixes: rejected red, down-classed magenta, not used grey",
            "- factor graph: a sample around the current time of poses x, landmarks l and fixes gps; select "
            "a node for its factors and residuals",
        ]
    )

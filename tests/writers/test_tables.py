import dataclasses
from pathlib import Path

import numpy as np
import pytest
from run_files import rows

from vgps.solution import Solution
from vgps.writers.run_folder import write_run


def test_poses_csv_has_geodetic_positions_and_sigmas(solution: Solution, tmp_path: Path) -> None:
    write_run(solution, tmp_path / "run")
    first, second, _, last = rows(tmp_path / "run/poses.csv")
    assert (first["frame"], first["state"], second["state"]) == ("0", "tracked", "bridged")
    assert float(first["heading_deg"]) == pytest.approx(90.0)  # the optical axis points east
    # 2 m north on the ellipsoid's meridian at 49.011 deg (radius 6 371 881 m), 1 m east on its parallel
    assert float(first["latitude_deg"]) - 49.011 == pytest.approx(2 / 6371881 * 180 / np.pi, rel=1e-4)
    assert float(first["longitude_deg"]) - 8.4165 == pytest.approx(
        1 / (6390338 * np.cos(np.radians(49.011))) * 180 / np.pi, rel=1e-4
    )
    assert float(first["height_m"]) == pytest.approx(166.0, abs=1e-5)
    assert [first[f"sigma_{axis}_m"] for axis in ("east", "north", "up")] == [
        "0.010000",
        "0.020000",
        "0.030000",
    ]
    assert [float(second[f"sigma_rot_{axis}_deg"]) for axis in ("east", "north", "up")] == [4.0, 5.0, 6.0]
    assert last["sigma_up_m"] == ""


def test_gps_csv_gives_each_fix_its_residual_ratio_and_verdict(solution: Solution, tmp_path: Path) -> None:
    write_run(solution, tmp_path / "run")
    inside, outside = rows(tmp_path / "run/gps.csv")
    assert (inside["line"], inside["class"], inside["used"]) == ("1", "rtk_fix", "yes")
    assert float(inside["ratio_r"]) == pytest.approx(0.5)  # hypot(3 cm, 4 cm) over 10 cm
    assert float(inside["ratio_h"]) == pytest.approx(2.0)  # 10 cm over 5 cm
    assert (inside["residual_north_m"], inside["east_m"]) == ("-0.040000", "0.500000")
    assert (outside["used"], outside["reason"]) == ("no", "outside the video, after its end")
    assert (outside["ratio_r"], outside["height_m"]) == ("", "")


def test_gps_csv_lists_the_fixes_of_a_run_that_did_not_look_at_them(
    solution: Solution, tmp_path: Path
) -> None:
    write_run(dataclasses.replace(solution, fixes=None), tmp_path / "run")
    first, _ = rows(tmp_path / "run/gps.csv")
    assert (first["latitude_deg"], first["used"], first["residual_east_m"]) == ("49.0110000000", "no", "")

from io import StringIO

import numpy as np
from rich.console import Console

from vgps.cli.tables import calibration_table
from vgps.gyro_calibration import GyroCalibration
from vgps.imu.mount_fit import Mount


def test_the_table_of_a_calibration_has_numbers_with_their_units():
    calibration = GyroCalibration(
        mount=Mount(np.eye(3), 0.0125, np.radians([0.3, -0.2, 0.1])),
        rotation_sigma_rad=np.radians([0.07, 0.25, 0.05]),
        time_offset_sigma_s=0.0034,
        bias_sigma_rad_s=np.radians([0.05, 0.02, 0.03]),
        offset_known=True,
        bias_known=True,
        intervals=299,
        missed=1,
        interval_s=0.1,
        rotation_rms_rad=np.radians([0.5, 2.7, 0.4]),
        residual_rad=np.radians([0.011, 0.012, 0.013]),
        agreement=0.9987,
        scale=1.002,
        notes=(),
    )
    page = StringIO()
    Console(file=page, width=160).print(calibration_table(calibration))
    rows = [[cell.strip() for cell in line.split("│")[1:-1]] for line in page.getvalue().splitlines()]
    found = {row[0]: row[1:] for row in rows if row}
    # brackets around a unit would be markup, and vanish
    assert found["rotation about the camera axes, deg"] == ["", "0.07  0.25  0.05"]
    assert found["time offset, added to gyro times, ms"] == ["12.50", "3.40"]
    assert found["bias in gyro axes, deg/s"] == ["0.300  -0.200  0.100", "0.050  0.020  0.030"]
    assert found["camera rotation in 100 ms, rms deg"] == ["0.500  2.700  0.400", ""]
    assert found["gyro minus camera, rms deg"] == ["0.011  0.012  0.013", ""]

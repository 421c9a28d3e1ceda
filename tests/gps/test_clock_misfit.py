from dataclasses import replace

import numpy as np
import pytest
from synthetic_fixes import fixes_at

from vgps.config import SensorsConfig
from vgps.gps.clock_misfit import Misfit, Seen, misfit_at

CONFIG = SensorsConfig()


@pytest.mark.parametrize("usual, refuted", [(0.02, True), (0.2, False)])
def test_what_coarse_fixes_may_well_leave_refutes_no_time_offset(usual, refuted):
    """RTK-fixes of a straight agree with a clip elsewhere; it lies among fixes that err by a fifth."""
    lengths, pairs = np.linspace(0.5, 1.5, 9), np.arange(9)
    elsewhere = Misfit(0.02 * lengths, np.full(9, 0.02), pairs, 13)
    here = Misfit(0.2 * lengths, np.full(9, usual), pairs + 20, 13)
    assert elsewhere.clearly_less(here, CONFIG.significance_sigmas, tried=60.0) == refuted
    common = here._replace(rows=pairs)  # with these very fixes it is
    assert elsewhere.clearly_less(common, CONFIG.significance_sigmas, tried=60.0)


@pytest.mark.parametrize("interval_s", [1.0, 2.0])
def test_errors_change_by_a_tenth_of_their_region_in_a_second_and_with_the_root_of_time(interval_s):
    t_s = interval_s * np.arange(10)
    fixes = replace(fixes_at(t_s, 3.0, 6.0), world_p_fix=np.outer(1.5 * t_s, [1.0, 0.0, 0.0]))
    found = misfit_at(Seen(t_s, 1.5 * t_s + 0j), fixes, 0.0, CONFIG.time_offset)
    moved_m, change_m = 1.5 * interval_s, 0.1 * 3.0 * np.sqrt(interval_s)
    np.testing.assert_allclose(found.usual, np.hypot(0.02, change_m / moved_m))
    assert found.degrees_of_freedom == 2 * 9 - 5

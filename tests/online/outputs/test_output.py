import io
import json
from datetime import UTC, datetime

import numpy as np

from vgps.model import GeodeticPoint
from vgps.online.estimate import OnlineEstimate, OnlineEvent, OnlineState
from vgps.online.outputs.output import JsonLines

# looks east from 1 m east, 2 m north, 3 m up
POSE = np.array([[0.0, 0.0, 1.0, 1.0], [-1.0, 0.0, 0.0, 2.0], [0.0, -1.0, 0.0, 3.0], [0.0, 0.0, 0.0, 1.0]])


def written(estimate: OnlineEstimate) -> list[dict]:
    stream = io.StringIO()
    lines = JsonLines(stream)
    lines.start_utc = datetime(2020, 1, 1, tzinfo=UTC)
    lines.write(estimate, latency_s=0.25)

    def refuse(constant: str) -> None:
        raise AssertionError(f"{constant} is not JSON")

    return [json.loads(line, parse_constant=refuse) for line in stream.getvalue().splitlines()]


def test_events_come_before_their_pose_and_every_line_has_its_schema_version() -> None:
    estimate = OnlineEstimate(
        frame=5,
        t_s=1.5,
        state=OnlineState.TRACKED,
        global_T_camera=POSE,
        local_T_camera=np.full((4, 4), np.nan),
        sigma_position_m=np.array([0.1, 0.2, np.nan]),
        sigma_rotation_rad=np.radians([1.0, 2.0, 3.0]),
        world_origin=GeodeticPoint(49.0, 8.0, 100.0),
        events=(OnlineEvent(1.25, "fix", "used", {"line": 3}),),
        seconds=0.01,
    )
    event, pose = written(estimate)
    assert (event["type"], event["t_s"], event["event"], event["line"]) == ("event", 1.25, "fix", 3)
    assert (pose["type"], pose["frame"], pose["state"], pose["latency_s"]) == ("pose", 5, "tracked", 0.25)
    assert pose["utc"] == "2020-01-01T00:00:01.500000+00:00"
    assert (event["schema_version"], pose["schema_version"]) == (1, 1)
    assert pose["local"] is None  # unknown
    there = pose["global"]
    assert [there[name] for name in ("east_m", "north_m", "up_m", "heading_deg")] == [1.0, 2.0, 3.0, 90.0]
    assert [there[name] for name in ("qx", "qy", "qz", "qw")] == [-0.5, 0.5, -0.5, 0.5]
    assert (there["sigma_east_m"], there["sigma_up_m"], there["sigma_rot_up_deg"]) == (0.1, None, 3.0)
    assert 49.0 < there["latitude_deg"] < 49.0001

"""Ask a landmark database what the camera of a run's frame would see."""

import argparse
from pathlib import Path

import numpy as np

from vgps.landmarks.database import LandmarkDatabase
from vgps.readers.run_folder import read_run


def main() -> None:
    """Print the nearest of the landmarks in view."""
    parser = argparse.ArgumentParser(prog="python -m scripts.examples.query_landmarks", description=__doc__)
    parser.add_argument("landmarks", type=Path, help="database, made by `vgps landmarks build`")
    parser.add_argument("run", type=Path, help="run folder in the database's world")
    parser.add_argument("--frame", type=int, default=0, help="frame of the run")
    given = parser.parse_args()
    run = read_run(given.run)
    pose = run.world_T_camera[given.frame]
    with LandmarkDatabase.open(given.landmarks) as database:
        views = database.views(pose, run.camera, max_landmarks=200)  # one view per landmark
    distance_m = np.linalg.norm(views.world_p_landmark - pose[:3, 3], axis=1)
    print(f"{len(views)} landmarks in view")
    for index in np.argsort(distance_m)[:5]:
        print(f"landmark {views.landmark[index]}: {distance_m[index]:.1f} m away")


if __name__ == "__main__":
    main()

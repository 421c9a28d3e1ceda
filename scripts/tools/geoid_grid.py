"""Make ``vgps/crs/egm96_15.npz`` from ``egm96_15.gtx``, which Debian's package proj-data has.

The grid is a work of the US government (NGA, NASA) in the public domain. Heights are rounded to 1 cm.
"""

import struct
from pathlib import Path

import numpy as np

from scripts.common.command import ScriptParser


def main() -> None:
    """Read the GTX file and write second differences, which compress to a sixth."""
    parser = ScriptParser("tools.geoid_grid", __doc__, measures=False)
    parser.add_argument("gtx", type=Path, help="egm96_15.gtx")
    parser.add_argument("--out", type=Path, required=True, help="the file to write")
    arguments = parser.parse_args()
    data = arguments.gtx.read_bytes()
    south, west, step, _ = struct.unpack(">4d", data[:32])
    rows, columns = struct.unpack(">2i", data[32:40])
    grid = np.frombuffer(data[40:], ">f4").reshape(rows, columns).astype(np.float64)
    centimetres = np.round(100.0 * grid).astype(np.int32)
    differences = np.diff(np.diff(centimetres, axis=1, prepend=0), axis=0, prepend=0).astype(np.int16)
    np.savez_compressed(arguments.out, differences=differences, corner=[south, west], step=step)


if __name__ == "__main__":
    main()

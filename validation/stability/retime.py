#!/usr/bin/python3
"""A prepared volume element with another DEM time step, as a script of YADE would set it without asking.

    retime.py STATE FACTOR OUT      STATE: file of the cache of `femxdem ve prepare`; OUT: where the new one goes
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "yade_scripts"))
import yade_modules

if __name__ == "__main__":
    state, factor, out = sys.argv[1:]
    O = yade_modules.load()
    O.stringToScene(Path(state).read_bytes())
    O.dt *= float(factor)
    Path(out).write_bytes(O.sceneToString())

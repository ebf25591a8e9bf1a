#!/usr/bin/python3
"""`femxdem advise` on a user's script of 80 spheres, from end to end: test_advise.py FEMXDEM CASES."""

import json
import subprocess
import sys
import tempfile
import tomllib
import unittest
from pathlib import Path

PROGRAM, CASES = (Path(p).resolve() for p in sys.argv[1:3])
SCRIPT = (CASES / "scripts/triaxial.py").read_text().format(
    material="FrictMat(young=5e7, poisson=.4, frictionAngle=radians(20), density=2600)", bodies="", geometry="Ig2_Sphere_Sphere_ScGeom",
    physics="Ip2_FrictMat_FrictMat_FrictPhys()", law="Law2_ScGeom_FrictPhys_CundallStrack()", step=".5 * PWaveTimeStep()",
    ready="O.pause()", run="O.run(60000, True)", end="",
)
CASE = """# mine
load = [
  { edge = "bottom", kind = "displacement", component = "y", value = 0.0 },
  { edge = "top", kind = "displacement", component = "y", value = -0.1 },
  { point = [0.5, 0.0], kind = "displacement", component = "x", value = 0.0 },
  { edge = "left", kind = "pressure", value = 1e5 },
  { edge = "right", kind = "pressure", value = 1e5 },
]
[mesh]
type = "rectangle"
width = 1.0
height = 2.0
nx = 2
ny = 4

[material]
type = "volume_element"

[ve]
source = "script"
script = "theirs.py" # beside the case
confining_stress = 1e5
inertial_number = 2e-2
max_unbalanced_force = 0.5

[control]
end_time = 1.0
step = 0.05
"""


class Advise(unittest.TestCase):
    def test_a_script(self):
        with tempfile.TemporaryDirectory() as folder:
            folder = Path(folder)
            (folder / "theirs.py").write_text(SCRIPT)
            (folder / "mine.toml").write_text(CASE)
            words = [PROGRAM, "advise", "mine.toml", "--error", "0.1", "--band", "0.4", "--write", "advised.toml"]
            said = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=550)
            print(said.stdout)
            self.assertEqual(said.returncode, 0, said.stderr)
            for topic in ("spheres", "rate", "time step", "increment", "tolerance", "softening", "elastic", "engine", "as it is", "as advised"):
                self.assertRegex(said.stdout, rf"(?m)^{topic} .*\d|^engine ")
            text = (folder / "advised.toml").read_text()
            self.assertIn('script = "theirs.py" # beside the case', text)
            case, told = tomllib.loads(text), json.loads((folder / "out/mine_advice/advice.json").read_text())
            self.assertEqual(case["control"]["max_step"], told["values"]["control.max_step"])
            self.assertEqual(case["ve"]["inertial_number"], told["values"]["ve.inertial_number"])
            self.assertNotIn("spheres", case["ve"])
            self.assertGreater(told["cost"]["dem_steps"], 32 * 20 * 10)
            checked = subprocess.run([PROGRAM, "check", "advised.toml"], cwd=folder, capture_output=True, text=True)
            self.assertEqual(checked.returncode, 0, checked.stderr)

    def test_refusals(self):
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / "law.toml").write_text('[material]\ntype = "elastic"\nyoung = 1e8\n')
            (Path(folder) / "theirs.py").write_text(SCRIPT)
            (Path(folder) / "mistaken.toml").write_text(CASE.replace("step = 0.05", "step = -0.05"))
            for words, reason in (
                (["nothere.toml"], "nothere.toml: no such file"), (["law.toml"], "a law in closed form, which needs no advice"),
                (["law.toml", "--error", "2"], "--error 2: a relative error"), (["law.toml", "--band", "-1"], "--band -1: a thickness"),
                (["mistaken.toml"], "control.step"),
            ):
                said = subprocess.run([PROGRAM, "advise", *words], cwd=folder, capture_output=True, text=True)
                self.assertEqual((said.returncode, len(said.stderr.splitlines())), (2, 1), said.stderr)
                self.assertIn(reason, said.stderr)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=2)

"""Scripts with other contact models than the program's own: their stress and their stiffness."""

import tempfile
import unittest
from pathlib import Path

import numpy as np

from cells import engine, mandel, measure, select, stiffness, users

SCRIPT = """
from yade import pack
O.periodic = True
O.cell.hSize = Matrix3(0.1, 0, 0, 0, 0.1, 0, 0, 0, 0.1)
cloud = pack.SpherePack()
cloud.makeCloud((0, 0, 0), (0.1, 0.1, 0.1), rMean=0.01, rRelFuzz=0.1, num=60, periodic=True, seed=3)
mat = O.materials.append(%(material)s)
%(grains)s
O.engines = [
    ForceResetter(),
    InsertionSortCollider([Bo1_Sphere_Aabb()]),
    InteractionLoop([%(geometry)s()], [%(physics)s()], [%(law)s]),
    PeriTriaxController(goal=(-1e5, -1e5, -1e5), stressMask=7, maxUnbalanced=1e-4, relStressTol=.01, dynCell=True, mass=1.0,
                        maxStrainRate=(%(rate)s,) * 3, globUpdate=5, doneHook='O.pause()'),
    NewtonIntegrator(damping=.4),
]
O.dt = %(step)s * PWaveTimeStep()
O.run()
O.wait()
"""
SPHERES = "cloud.toSimulation(material=mat)"
# YADE's replaceByClumps would turn the clumps at random, by the clock.
PAIRS = """
import random
draw = random.Random(3)
for centre, radius in cloud:
    axis = Vector3(*(draw.gauss(0, 1) for _ in range(3))).normalized()
    O.bodies.appendClumped([sphere(centre + side * 0.8 * radius * axis, 0.8 * radius, material=mat) for side in (-1, 1)])
"""
FRICTIONAL = "young=1e8, poisson=0.3, frictionAngle=%s"
MODELS = {
    "frictional": {},
    "Hertz-Mindlin": {
        "material": "FrictMat(young=5e8, poisson=0.3, frictionAngle=0.4)",
        "physics": "Ip2_FrictMat_FrictMat_MindlinPhys",
        "law": "Law2_ScGeom_MindlinPhys_Mindlin()",
        "rate": 1.5,
    },
    "jointed cohesive": {
        "material": "JCFpmMat(young=1e8, poisson=0.3, frictionAngle=0.4, cohesion=1e6, tensileStrength=1e6)",
        "physics": "Ip2_JCFpmMat_JCFpmMat_JCFpmPhys",
        "law": "Law2_ScGeom_JCFpmPhys_JointedCohesiveFrictionalPM()",
    },
    "rolling resistance": {
        "material": "CohFrictMat(young=1e8, poisson=0.3, frictionAngle=0.4, alphaKr=1, alphaKtw=1, etaRoll=0.1, momentRotationLaw=True, isCohesive=False)",
        "geometry": "Ig2_Sphere_Sphere_ScGeom6D",
        "physics": "Ip2_CohFrictMat_CohFrictMat_CohFrictPhys",
        "law": "Law2_ScGeom6D_CohFrictPhys_CohesionMoment(always_use_moment_law=True, useIncrementalForm=True)",
    },
    "clumps without friction": {"material": f"FrictMat({FRICTIONAL % 0})", "grains": PAIRS, "step": 0.3},
}
DEFAULTS = {
    "material": f"FrictMat({FRICTIONAL % 0.4})",
    "grains": SPHERES,
    "geometry": "Ig2_Sphere_Sphere_ScGeom",
    "physics": "Ip2_FrictMat_FrictMat_FrictPhys",
    "law": "Law2_ScGeom_FrictPhys_CundallStrack()",
    "step": 0.5,
    "rate": 1.0,
}


def element(model, **changes):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "theirs.py"
        path.write_text(SCRIPT % {**DEFAULTS, **MODELS[model], **changes})
        made = engine().make_template(users("script", path, script_steps=60_000))
    print(model, {k: made["manifest"][k] for k in ("spheres", "contacts", "unbalanced_force", "notes", "porosity")})
    return engine().add(made["state"]), made["manifest"]


class Models(unittest.TestCase):
    def test_stress_and_stiffness(self):
        """The controller has left the stress at 1e5 Pa; the stiffness from kn, ks is the probed one."""
        import probing

        for model in ("frictional", "Hertz-Mindlin", "jointed cohesive", "rolling resistance"):
            with self.subTest(model):
                ve, _ = element(model)
                stress = measure(ve)[0]
                C = stiffness(ve)
                probed = probing.stiffness(select(ve), engine()._love_weber)
                error = np.linalg.norm(C - probed) / np.linalg.norm(probed)
                print(f"{model}: stress {np.diag(stress)}, Eq. (2) against probes {error:.2%}")
                np.testing.assert_allclose(np.diag(stress), -1e5, rtol=0.03)
                self.assertLess(error, 0.03)


class Clumps(unittest.TestCase):
    def test_work_of_the_stress_is_the_energy_of_the_contacts(self):
        """Slow compression of frictionless clumps: V sigma : D is the rate of the elastic energy of the contacts, so YADE's
        branch vectors are those between clumps, not between their spheres."""
        ve, manifest = element("clumps without friction")
        O = select(ve)
        energy = lambda: sum(i.phys.normalForce.squaredNorm() / (2 * i.phys.kn) for i in O.interactions)
        time_step, trials, strain = manifest["time_step"], 40, 2e-4
        start, work = energy(), 0.0
        L = -strain / (10 * trials * time_step) * np.eye(3)
        for _ in range(trials):
            engine().deform(ve, L, 10)
            work += np.sum(measure(ve)[0] * L) * O.cell.volume * 10 * time_step
        gained = energy() - start
        print(f"energy {gained:.4e} J, work {work:.4e} J")
        self.assertAlmostEqual(work / gained, 1, delta=0.01)

    def test_probed_stiffness_is_symmetric_and_positive(self):
        ve, _ = element("clumps without friction")
        M = mandel(stiffness(ve))
        np.testing.assert_allclose(M, M.T, rtol=0, atol=1e-12 * np.abs(M).max())
        self.assertGreater(np.linalg.eigvalsh(M).min(), 0)


if __name__ == "__main__":
    unittest.main()

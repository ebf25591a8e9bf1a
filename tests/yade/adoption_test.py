"""Users' scenes and scripts as volume elements, and the true reason where one cannot serve."""

import hashlib
import os
import random
import tempfile
import unittest
from pathlib import Path

import numpy as np

import adoption
from cells import FRICTION, element, engine, measure, rate, select, users

EXAMPLES = Path("/usr/share/doc/yade/examples")
SCRIPT = """
import sys
from yade import pack, plot, qt
O.periodic = True
O.cell.hSize = Matrix3(0.1, 0, 0, 0, 0.1, 0, 0, 0, 0.1)
cloud = pack.SpherePack()
cloud.makeCloud((0, 0, 0), (0.1, 0.1, 0.1), rMean=0.01, rRelFuzz=0.1, num=int(sys.argv[1]), periodic=True, seed=3)
cloud.toSimulation(material=FrictMat(young=1e7, poisson=0.3, frictionAngle=radians(20)))
O.engines = [
    ForceResetter(),
    InsertionSortCollider([Bo1_Sphere_Aabb()]),
    InteractionLoop(
        [Ig2_Sphere_Sphere_ScGeom()], [Ip2_FrictMat_FrictMat_FrictPhys()], [Law2_ScGeom_FrictPhys_CundallStrack()]
    ),
    PeriTriaxController(label='triax', goal=(-1e4, -1e4, -1e4), stressMask=7, maxUnbalanced=.05, relStressTol=.05,
                        maxStrainRate=(1, 1, 1), globUpdate=5, doneHook='finished()'),
    NewtonIntegrator(damping=.4),
    PyRunner(command='remember()', iterPeriod=50),
]
O.dt = 0.5 * PWaveTimeStep()
qt.View()
seen = []
def remember():
    seen.append(O.iter)
def finished():
    O.pause()
"""


class Folder(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def script(self, end="O.run()\nO.wait()", spheres="60"):
        path = self.folder / "theirs.py"
        path.write_text(SCRIPT + end + "\n")
        return users("script", path, arguments=[spheres], script_seconds=120.0)


class Script(Folder):
    def test_runs_unchanged_and_is_adopted_at_rest_in_its_reference_state(self):
        made = engine().make_template(self.script())
        m = made["manifest"]
        self.assertEqual(m["spheres"], 60)
        self.assertEqual(m["dropped"], ["PeriTriaxController (triax)", "PyRunner"])
        self.assertEqual(m["kept"], list(adoption.KEPT))
        self.assertEqual(len(m["reset"]), 3)
        self.assertEqual(m["scene_unit_of_time"], 1.0)
        ve = engine().add(made["state"])
        stress, _, F = measure(ve)
        np.testing.assert_allclose(np.diag(stress), -1e4, rtol=0.1)
        np.testing.assert_array_equal(F, np.eye(3))
        L = rate(ve, 1e-3, np.diag([0.0, -1.0, 0.0]))
        engine().deform(ve, L, 50)
        end = np.linalg.matrix_power(np.eye(3) + L * m["time_step"], 50)
        np.testing.assert_allclose(measure(ve)[2], end, rtol=0, atol=1e-14)

    def test_a_script_that_never_ends_is_stopped_and_says_so(self):
        spec = {**self.script("triax.maxUnbalanced = 0\nwhile True:\n    O.run(3000, True)"), "script_steps": 20000}
        made = [engine().make_template(spec) for _ in range(2)]
        self.assertEqual(made[0]["manifest"]["notes"][0], "the script's simulation was stopped after 20000 steps")
        self.assertEqual(made[0]["manifest"]["stress"], made[1]["manifest"]["stress"])
        spec = {**self.script("while True:\n    pass"), "script_seconds": 1.0}
        with self.assertRaisesRegex(ValueError, "made no DEM step in ve.script_seconds = 1 s"):
            engine().make_template(spec)

    def test_an_error_of_a_hook_is_the_reason(self):
        end = "def finished():\n    raise KeyError('stress of my own')\nO.run()\nO.wait()"
        with self.assertRaisesRegex(ValueError, "failed in one of its hooks: KeyError: 'stress of my own'"):
            engine().make_template(self.script(end))

    def test_a_script_that_does_not_start_its_simulation_is_run_until_its_hooks_pause_it(self):
        manifest = engine().make_template(self.script(end=""))["manifest"]
        self.assertIn("did not start its simulation", manifest["notes"][0])
        self.assertGreater(manifest["contacts"], 60)

    def test_refusals(self):
        for extra, reason in (
            ("O.engines = O.engines + [TranslationEngine(ids=[0])]", "engine TranslationEngine, which acts on"),
            ("O.engines = O.engines[:4] + O.engines[5:]", "0 engines NewtonIntegrator"),
            ("O.engines = [O.engines[4]] + O.engines[:4]", "NewtonIntegrator last"),
            ("1 / 0", "failed: ZeroDivisionError"),
            ("O.bodies.append(box((0.05, 0.05, 0.05), (0.001,) * 3))", "is a Box"),
            ("O.bodies[3].dynamic = False", "Body 3 of the YADE scene is held"),
        ):
            with self.subTest(reason), self.assertRaisesRegex(ValueError, reason):
                engine().make_template(self.script(end="O.step()\n" + extra))

    def test_moments_of_contacts_are_taken_away_where_the_case_says_so(self):
        rolling = {
            "FrictMat(young=1e7,": "CohFrictMat(momentRotationLaw=True, alphaKr=2, alphaKtw=2, etaRoll=0.5, isCohesive=False, young=1e7,",
            "Ig2_Sphere_Sphere_ScGeom()": "Ig2_Sphere_Sphere_ScGeom6D()",
            "Ip2_FrictMat_FrictMat_FrictPhys()": "Ip2_CohFrictMat_CohFrictMat_CohFrictPhys()",
            "Law2_ScGeom_FrictPhys_CundallStrack()": "Law2_ScGeom6D_CohFrictPhys_CohesionMoment(always_use_moment_law=True)",
        }
        spec, by_hand = self.script(), self.folder / "by_hand.py"
        theirs = self.folder / "theirs.py"
        for a, b in rolling.items():
            theirs.write_text(theirs.read_text().replace(a, b))
        without = "O.engines[2].lawDispatcher.functors[0].always_use_moment_law = False\nfor x in [b.mat for b in O.bodies] + [i.phys for i in O.interactions]: x.momentRotationLaw = False\n"
        zero = "for i in O.interactions: i.phys.moment_bending = i.phys.moment_twist = Vector3.Zero; i.phys.kr = i.phys.ktw = 0\n"
        by_hand.write_text(theirs.read_text() + without + zero)
        stresses = []
        for asked in (spec, {**spec, "moments": False}, {**spec, "script": str(by_hand)}):
            made = engine().make_template(asked)
            self.assertEqual(made["manifest"]["moments"], asked["script"] != str(by_hand))
            ve = engine().add(made["state"])
            engine().deform(ve, rate(ve, 2e-2, np.diag([0.5, -1.0, 0.5])), 400)
            stresses.append(measure(ve)[0])
        np.testing.assert_array_equal(stresses[1], stresses[2])
        self.assertGreater(np.abs(stresses[0] - stresses[1]).max(), 0.05 * np.abs(stresses[0]).max())

    def test_missing_script(self):
        with self.assertRaisesRegex(ValueError, "ve.script = .*no such file"):
            engine().make_template(users("script", "/nowhere/theirs.py"))


class Scene(Folder):
    def test_saved_scenes_serve_as_they_are(self):
        ve = element(FRICTION)
        O = select(ve)
        engine().deform(ve, rate(ve, 5e-3, np.diag([0.5, -1.0, 0.5])), 20)
        for name in ("a.yade.gz", "b.xml.bz2"):
            path = self.folder / name
            select(ve)
            O.save(str(path))
            made = engine().make_template(users("scene", path))
            other = engine().add(made["state"])
            stress, _, F = measure(other)
            np.testing.assert_array_equal(F, np.eye(3))
            np.testing.assert_allclose(stress, measure(ve)[0], rtol=0, atol=1e-9 * 1e5)
            for quantity in ("time_scale", "time_step"):  # [s], though a prepared scene counts in another unit
                ratio = engine().info(other)[quantity] / engine().info(ve)[quantity]
                self.assertAlmostEqual(ratio, 1, delta=1e-9 if quantity == "time_scale" else 0.05)
            self.assertIn("velocity gradient of the cell set to zero", made["manifest"]["reset"])

    def test_missing_and_broken_scenes(self):
        with self.assertRaisesRegex(ValueError, "ve.scene = .*no such file"):
            engine().make_template(users("scene", "/nowhere/scene.yade.gz"))
        broken = self.folder / "broken.xml"
        broken.write_text("<nothing/>")
        with self.assertRaisesRegex(ValueError, "cannot be loaded"):
            engine().make_template(users("scene", broken))

    def test_an_archive_is_loaded_by_its_checksum_alone(self):
        path, another = self.folder / "theirs.xml", "0" * 64
        path.write_text("<nothing/>")
        own = hashlib.sha256(path.read_bytes()).hexdigest()
        for given, reason in (("", f'if you trust it write ve.scene_sha256 = "{own}"'), (another, f"is not the file .* its own is {own}"),
                              (own.upper(), "cannot be loaded")):
            with self.subTest(given), self.assertRaisesRegex(ValueError, reason):
                engine().make_template(users("scene", path, scene_sha256=given))


@unittest.skipUnless(EXAMPLES.is_dir(), "YADE's examples are not installed")
class ShippedExamples(unittest.TestCase):
    """Scripts of YADE's package, unedited: volume elements, or refused with the true reason."""

    SERVE = {  # DEM steps of each script: what is reached is the same on every machine
        "PeriodicBoundaries/cellFlipping.py": 100_000,
        "PeriodicBoundaries/periodic-grow.py": 8_000,
        "PeriodicBoundaries/periodic-simple-shear.py": 8_000,
        "PeriodicBoundaries/periodic-triax.py": 8_000,
        "PeriodicBoundaries/peri3dController_triaxialCompression.py": 3_000,
        "FEMxDEM/prepareRVE.py": 12_000,
    }
    REFUSED = {
        "PeriodicBoundaries/periodic-shear.py": "Body 0 of the YADE scene is a Facet",
        "PeriodicBoundaries/periodicSandPile.py": "Body 0 of the YADE scene is a Box",
        "PeriodicBoundaries/periodic-simple.py": "has the engine TranslationEngine",
        "concrete/periodic.py": "archive does not keep .* Law2_ScGeom_CpmPhys_Cpm.*shear forces by",
    }

    def make(self, name, steps):
        with tempfile.TemporaryDirectory() as folder:  # the scripts write where they run
            here = os.getcwd()
            os.chdir(folder)
            random.seed(1)  # periodic-grow.py places its grains at random
            try:
                return engine().make_template(users("script", EXAMPLES / name, script_steps=steps))
            finally:
                os.chdir(here)

    def test_serve(self):
        for name, steps in self.SERVE.items():
            with self.subTest(name):
                made = self.make(name, steps)
                own = made["manifest"]["continuation"]["difference"]["at rest"]
                for what in ("stress", "normal forces", "shear forces", "contacts", "elastic energy"):
                    self.assertLess(own[what], 1e-9, what)  # against the scene's own continuation in YADE
                ve = engine().add(made["state"])
                L = np.diag([0.0, -1e-5, 0.0]) / engine().info(ve)["time_step"]
                engine().deform(ve, L, 20)
                stress, report, F = measure(ve)
                self.assertAlmostEqual(F[1, 1], (1 - 1e-5) ** 20, delta=1e-13)
                self.assertTrue(np.isfinite(stress).all() and stress.any())
                self.assertGreater(report["contacts"], 0)
                engine().remove(ve)

    def test_refused(self):
        for name, reason in self.REFUSED.items():
            with self.subTest(name), self.assertRaisesRegex(ValueError, reason):
                self.make(name, 3000 if "archive" in reason else 10)


if __name__ == "__main__":
    unittest.main()

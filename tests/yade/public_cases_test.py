"""Kinds of scripts that people publish and that were answered wrongly once: the right value, or the refusal that names it."""

import os
import tempfile
import unittest
from pathlib import Path

import numpy as np

import continuation
from cells import engine, measure, rate, users

SCRIPT = (Path(__file__).parents[1] / "cases/scripts/triaxial.py").read_text()
DEFAULTS = {
    "material": "FrictMat(young=5e7, poisson=.4, frictionAngle=radians(20), density=2600)",
    "bodies": "",
    "geometry": "Ig2_Sphere_Sphere_ScGeom",
    "physics": "Ip2_FrictMat_FrictMat_FrictPhys()",
    "law": "Law2_ScGeom_FrictPhys_CundallStrack()",
    "step": ".5 * PWaveTimeStep()",
    "ready": "O.pause()",
    "run": "O.run(60000, True)",
    "end": "",
}
CPM = {
    "material": "CpmMat(density=2600, young=5e7, poisson=.2, frictionAngle=0., sigmaT=1e6, epsCrackOnset=1e-2, "
    "relDuctility=30, neverDamage=True)",
    "physics": "Ip2_CpmMat_CpmMat_CpmPhys(cohesiveThresholdIter=0)",
    "law": "Law2_ScGeom_CpmPhys_Cpm()",
    "end": "for i in O.interactions: i.phys.tanFrictionAngle = tan(radians(25))",
}
MINDLIN = {
    "physics": "Ip2_FrictMat_FrictMat_MindlinPhys(%s)",
    "law": "Law2_ScGeom_MindlinPhys_Mindlin()",
    "step": ".1 * PWaveTimeStep()",
}
VISCOELASTIC = {
    "material": "ViscElMat(kn=1e6, ks=5e5, cn=%g, cs=%g, frictionAngle=radians(20), density=2600)",
    "physics": "Ip2_ViscElMat_ViscElMat_ViscElPhys()",
    "law": "Law2_ScGeom_ViscElPhys_Basic()",
    "step": "5e-6",
    "run": "O.run(150000, True)",
}
ROLLING = {
    "material": "CohFrictMat(young=5e7, poisson=.4, frictionAngle=radians(20), density=2600, isCohesive=False, "
    "momentRotationLaw=True, alphaKr=%g, alphaKtw=%g, etaRoll=1)",
    "geometry": "Ig2_Sphere_Sphere_ScGeom6D",
    "physics": "Ip2_CohFrictMat_CohFrictMat_CohFrictPhys()",
    "law": "Law2_ScGeom6D_CohFrictPhys_CohesionMoment(always_use_moment_law=True, useIncrementalForm=True)",
    "step": ".1 * PWaveTimeStep()",
}


class Scripts(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.addCleanup(os.chdir, os.getcwd())
        os.chdir(folder.name)

    def make(self, **changes):
        Path("theirs.py").write_text(SCRIPT.format(**{**DEFAULTS, **changes}))
        return engine().make_template(users("script", os.path.abspath("theirs.py"), script_steps=160_000))

    def refused(self, reason, **changes):
        with self.assertRaisesRegex(ValueError, reason):
            self.make(**changes)


class State(Scripts):
    def test_what_the_archive_drops_is_refused_by_the_law_s_name(self):
        self.refused("archive does not keep .*Law2_ScGeom_CpmPhys_Cpm.*shear forces by [0-9.]+e-01", **CPM)

    def test_permanent_forces(self):
        push = "for b in O.bodies: O.forces.set%s(b.id, (0, 5e3*b.state.mass*(-1)**b.id, 0))"
        for name in ("PermF", "PermT"):
            self.refused("Permanent forces or torques .* on 80 bodies", end=push % name)
        self.make(end=push % "PermF" + "\nfor b in O.bodies: O.forces.setPermF(b.id, (0, 0, 0))\nO.run(3000, True)")

    def test_every_template_goes_on_as_its_scene_does(self):
        for changes in ({}, {k: MINDLIN[k] % "" if k == "physics" else v for k, v in MINDLIN.items()}):
            found = self.make(**changes)["manifest"]["continuation"]
            self.assertEqual(found["steps"], continuation.FEW_STEPS)
            for what in ("stress", "normal forces", "shear forces", "contacts", "elastic energy"):
                self.assertLess(found["difference"]["at rest"][what], 1e-9, what)
            self.assertGreater(found["difference"]["as it was left"]["stress"], 1e-6)

    def test_a_scene_left_in_motion_is_said(self):
        notes = self.make()["manifest"]["notes"]
        self.assertRegex(notes[-1], "was left in motion.* differ: stress [0-9.]+e-0")


class Held(Scripts):
    def test_some_grains(self):
        for dofs, reason in (("xyz", "20 of 80"), ("x", "20 of 80"), ("zXY", "20 of 80")):
            hold = f"for b in O.bodies:\n    if b.id % 4 == 0: b.state.blockedDOFs = '{dofs}'"
            self.refused(f"{reason} grains of the YADE scene, body 0 among them, have their translations blocked", end=hold)

    def test_all_grains(self):
        self.refused("All grains .* blocked", end="for b in O.bodies: b.state.blockedDOFs = 'xyz'")
        for dofs in ("zXY", "XYZ"):
            self.make(bodies=f"for b in O.bodies: b.state.blockedDOFs = '{dofs}'" if dofs == "XYZ" else "",
                      end="" if dofs == "XYZ" else f"for b in O.bodies: b.state.blockedDOFs = '{dofs}'")


    def test_what_else_leaves_grains_where_they_are(self):
        self.refused("moves only bodies of its mask 2, so not 80 bodies", end="O.engines[-1].mask = 2")
        self.refused("Body 3 .* has the mass 0 kg", end="O.bodies[3].state.mass = 0")
        made = self.make(end="for b in O.bodies: b.state.densityScaling = .25")
        self.assertIn("density scaling of 80 bodies taken off", made["manifest"]["reset"])

    def test_forces_of_a_hook_are_missed(self):
        push = "def push():\n    for b in O.bodies: O.forces.addF(b.id, (0, 50*(-1)**b.id, 0))\n" \
               "O.engines = O.engines[:3] + [PyRunner(command='push()', iterPeriod=1)] + O.engines[4:]\nO.run(5000, True)"
        notes = self.make(end=push)["manifest"]["notes"]
        self.assertRegex(notes[0], "adoption itself changed the scene: .*unbalanced force .*PyRunner")


class Contacts(Scripts):
    def test_stiffnesses_that_are_there_and_not_filled(self):
        made = self.make(law="Law2_ScGeom_MindlinPhys_MindlinDeresiewitz()", physics="Ip2_FrictMat_FrictMat_MindlinPhys()")
        self.assertIn(made["manifest"]["time_step_from"], ("the scene", "P waves"))
        ve = engine().add(made["state"])
        engine().deform(ve, rate(ve, 1e-3, np.diag([0.0, -1.0, 0.0])), 200)
        np.testing.assert_allclose(np.diag(measure(ve)[0]), -1e5, rtol=0.3)
        engine().remove(ve)

    def test_stress_that_is_not_a_number(self):
        self.refused("not a number|not numbers", end="O.bodies[3].state.pos = Vector3(float('nan'), 0, 0)")
        self.refused("not a number", end="for i in O.interactions: i.phys.kn = float('nan')")

    def test_two_laws_in_one_packing(self):
        made = self.make(
            bodies="coh = O.materials.append(CohFrictMat(young=5e7, poisson=.4, frictionAngle=radians(20), density=2600, "
            "isCohesive=True, normalCohesion=1e6, shearCohesion=1e6))\n"
            "for b in O.bodies:\n    if b.id % 2: b.mat = O.materials[coh]",
            geometry="Ig2_Sphere_Sphere_ScGeom6D",
            physics="Ip2_FrictMat_FrictMat_FrictPhys(), Ip2_CohFrictMat_CohFrictMat_CohFrictPhys("
            "setCohesionOnNewContacts=True)",
            law="Law2_ScGeom_FrictPhys_CundallStrack(), Law2_ScGeom6D_CohFrictPhys_CohesionMoment(useIncrementalForm=True)",
        )["manifest"]
        self.assertEqual(made["time_step_from"], "contact network")
        self.assertTrue(0.1 < made["adhesive_contacts"] < 0.5, made["adhesive_contacts"])


class Dashpots(Scripts):
    def stable(self, changes, strain=1e-2):
        """Stresses along an axial compression in the volume element's own step and in a tenth of it, and the template."""
        made = self.make(**changes)
        stresses = []
        for fraction in (1, 0.1):
            ve = engine().add(made["state"])
            engine().O.dt *= fraction
            L = rate(ve, 5e-3, np.diag([0.2, -1.0, 0.2]))
            steps = round(strain / (np.linalg.norm(L) * engine().O.dt))
            engine().deform(ve, L, steps)
            stress, report, _ = measure(ve)
            stresses.append(np.diag(stress))
            self.assertLess(report["unbalanced_force"], 0.1)
            engine().remove(ve)
        return made["manifest"], np.linalg.norm(stresses[0] - stresses[1]) / np.linalg.norm(stresses[1])

    def test_of_hertzian_contacts(self):
        for beta in (0.1, 0.3):
            changes = {**MINDLIN, "physics": MINDLIN["physics"] % f"betan={beta}, betas={beta}"}
            manifest, error = self.stable(changes)
            print(f"beta {beta}: step {manifest['time_step']:.3g} s, from {manifest['time_step_from']}, error {error:.1e}")
            self.assertEqual(manifest["time_step_from"], "contact network with its dashpots")
            self.assertLess(error, 0.05)

    def test_of_linear_contacts(self):
        for c in (0.0, 20.0, 100.0):
            manifest, error = self.stable({**VISCOELASTIC, "material": VISCOELASTIC["material"] % (c, c / 2)})
            print(f"c {c:g} N s/m: step {manifest['time_step']:.3g} s, from {manifest['time_step_from']}, error {error:.1e}")
            self.assertEqual(manifest["time_step_from"], "contact network" + (" with its dashpots" if c > 0 else ""))
            self.assertLess(error, 0.05)


    def test_of_rolling(self):
        for alpha in (1, 5):
            manifest, error = self.stable({**ROLLING, "material": ROLLING["material"] % (alpha, alpha)})
            print(f"alpha {alpha}: step {manifest['time_step']:.3g} s, from {manifest['time_step_from']}, error {error:.1e}")
            self.assertLess(error, 0.05)


class Ends(Scripts):
    def test_a_script_may_end_its_process_in_a_hook_or_by_itself(self):
        usual = self.make()["manifest"]
        ways = ("sys.exit(0)", "os._exit(3)", "exit()", "quit()", "os.abort()", "os.kill(os.getpid(), 9)",
                "O.exitNoBacktrace()", "signal.raise_signal(15)")
        for way in ways:
            for changes in ({"ready": way, "run": "O.run()\nO.wait()"}, {"end": way}, {"ready": way, "run": "O.run()"}):
                with self.subTest(way, **changes):
                    made = self.make(bodies="import os, sys, signal", **changes)["manifest"]
                    self.assertRegex(made["notes"][0], "the script called exit")
                    np.testing.assert_allclose(made["stress"], usual["stress"], rtol=0.02, atol=300)

    def test_windows_do_nothing(self):
        made = self.make(
            bodies="from yade.qt import *\nfrom yade import qt\nimport yade.qt as window",
            end="v = View(); v.eyePosition = (1, 0, 0); r = Renderer(); r.bgColor = (1, 1, 1)\nassert len(views()) == 0\n"
            "for w in qt.views(): w.close()\nqt.Controller(); qt.center(); window.Inspector()\nif qt.View(): pass\n"
            "O.engines = O.engines + [qt.SnapshotEngine(iterPeriod=10, fileBase='x'), qt._Thing()]\nO.run(50, True)",
        )["manifest"]
        self.assertIn("SnapshotEngine", made["dropped"])


class Inputs(Scripts):
    def test_files_and_modules_are_recorded_with_their_contents(self):
        Path("conf.txt").write_text("1e5\n")
        Path("helper.py").write_text("mu = 20\n")
        read = "import helper, os\nconf = float(open('conf.txt').read())\nos.path.exists('no')\ntry: open('optional.txt')\n" \
               "except OSError: pass\nopen('written.txt', 'w').write('x')\nopen('written.txt').read()"
        first = dict(self.make(bodies=read)["manifest"]["inputs"])
        self.assertEqual(first["conf.txt"], "4-" + "%08x" % __import__("zlib").crc32(b"1e5\n"))
        self.assertEqual(first["optional.txt"], "missing")
        self.assertEqual(len(first), 3, first)
        Path("helper.py").write_text("mu = 25\n")
        second = dict(self.make(bodies=read)["manifest"]["inputs"])
        changed = [name for name in first if first[name] != second[name]]
        self.assertEqual([Path(name).name for name in changed], ["helper.py"])


if __name__ == "__main__":
    unittest.main()

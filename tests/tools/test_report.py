"""The HTML page of a run: what is in it, and that a browser opens it without errors and without a network."""

import json
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "fe_master" / "program"))
import report
from results import ResultsError
from sample_run import write_run

BROWSER = shutil.which("chromium-headless-shell") or shutil.which("chromium")
STEPS = [0, 5, 10]


def squeeze(x, step):
    """A band across the middle."""
    return 1e-3 * step * np.column_stack([np.zeros(len(x)), -np.tanh(8 * (x[:, 1] - 1.0 - 0.5 * (x[:, 0] - 0.5)))])


def gradient(x, step):
    slope = -8e-3 * step / np.cosh(8 * (x[:, 1] - 1.0 - 0.5 * (x[:, 0] - 0.5))) ** 2
    G = np.zeros((len(x), 2, 2))
    G[:, 1, 0], G[:, 1, 1] = -0.5 * slope, slope
    return G


def text_of(page):
    return re.search(r'<script id="data" type="application/json">(.*?)</script>', page, re.S).group(1)


class Page(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.temporary.cleanup)
        cls.folder = Path(cls.temporary.name) / "run"
        cls.folder.mkdir()
        write_run(cls.folder, squeeze, gradient, STEPS, nx=6, ny=12)
        case = cls.folder / "case.toml"
        case.write_text('# <script>alert("</pre>")</script>\n' + case.read_text())
        cls.folder.joinpath("log.txt").write_text("engine: compact cells; every template equals YADE's to the bit over 20 steps\n")
        cls.folder.joinpath("summary.json").write_text(json.dumps({
            "status": "done", "message": "10 steps to time 1", "date": "2026-11-26T00:00:00Z", "host": "here", "steps": 10,
            "evaluations": 15, "engine_check": "23 of 23 trials equal YADE's to the bit", "wall_seconds": 12.5, "parallel_efficiency": None,
            "versions": {"femxdem": "0.1.0", "yade": "2023.02a"}}))
        cls.page = report.page(cls.folder)

    def test_everything_is_there(self):
        for part in ("10 steps to time 1", "engine: compact cells", "23 of 23 trials", "2023.02a", "Thickness", "sigma_0",
                     "max=\"2\"", "accepted residual", "12.5 s", "&lt;script&gt;alert"):
            self.assertIn(part, self.page)
        self.assertNotIn("alert(\"", self.page)
        self.assertLess(len(self.page), 1_000_000)

    def test_the_data_are_those_of_the_steps(self):
        data = json.loads(text_of(self.page))
        self.assertEqual([s["label"].split(",")[0] for s in data["steps"]], [f"step {k}" for k in STEPS])
        mesh, step = report.read_mesh(self.folder), report.read_step(self.folder)
        np.testing.assert_allclose(data["steps"][-1]["fields"]["strain_invariant"], step.fields["strain_invariant"].ravel(), rtol=1e-3, atol=1e-12)
        np.testing.assert_allclose(np.reshape(data["steps"][-1]["displacement"], (-1, 2)), step.displacement, atol=1e-4)
        self.assertEqual(data["quarters"], [0, 1, 2, 3])
        self.assertEqual(np.shape(data["elements"]), mesh.elements.shape)

    def test_the_number_of_steps_is_limited(self):
        self.assertEqual(report.shown_steps(self.folder, report.NUMBERS // 2), [0, 10])
        self.assertEqual(report.shown_steps(self.folder, 100), STEPS)

    def test_nothing_is_loaded_from_elsewhere(self):
        self.assertEqual(re.findall(r'(?:src|href)="(?!#)[^"]*"|url\((?!#)[^)]*\)|@import', self.page), [])

    def test_a_run_that_goes_on_or_has_no_maps_still_gets_its_page(self):
        folder = Path(self.temporary.name) / "going"
        shutil.copytree(self.folder, folder)
        folder.joinpath("summary.json").unlink()
        folder.joinpath("results.h5").unlink()
        case = folder / "case.toml"
        case.write_text(case.read_text().split("[[monitor]]")[0])
        page = report.page(folder)
        self.assertIn("has not ended", page)
        self.assertIn("has no maps", page)

    def test_a_single_point_is_drawn_over_the_strain_that_drives_it(self):
        folder = Path(self.temporary.name) / "point"
        folder.mkdir()
        folder.joinpath("case.toml").write_text("[ve]\nconfining_stress = 1e5\n[[path]]\nstrain_yy = -0.02\nstress_xx = -1e5\n")
        names = [f"{q}_{c}" for q in ("strain", "stress") for c in ("xx", "yy", "zz", "xy", "yz", "zx")]
        rows = "".join(f"{k},{k},1,1,1e-3,{0.03 * k},{-0.01 * k},0,0,0,0,-1e5,{-1e5 - 1e5 * k},-1.5e5,0,0,0\n" for k in range(3))
        folder.joinpath("history.csv").write_text("step,time,load_factor,evaluations,residual," + ",".join(names) + "\n" + rows)
        curves = report.point_curves(folder)
        self.assertEqual([c.label for c in curves], ["stress xx", "stress yy", "stress zz"])
        np.testing.assert_allclose(curves[1].strain, [0, 0.01, 0.02])
        np.testing.assert_allclose(curves[1].stress, [1, 2, 3])
        self.assertIn("Single volume element", report.page(folder))
        run = report.curves_of(self.folder, folder)
        self.assertEqual((len(run[0]), run[1]), (2, folder))

    def test_an_annulus_is_asked_for_spirals(self):
        self.assertTrue(report.is_cylinder({"mesh": {"type": "annulus"}}, report.run_curve(self.folder)))
        self.assertFalse(report.is_cylinder(report.read_case(self.folder), report.run_curve(self.folder)))
        self.assertIn("Not measured: no band starts at the wall", report.band_text(self.folder, True))

    def test_a_folder_without_a_run_is_one_sentence_and_status_2(self):
        with self.assertRaises(ResultsError):
            report.page(self.temporary.name)
        done = subprocess.run([sys.executable, report.__file__, self.temporary.name], capture_output=True, text=True)
        self.assertEqual((done.returncode, done.stderr.count("\n")), (2, 1), done.stderr)
        self.assertIn("give the folder that `femxdem run` wrote", done.stderr)


@unittest.skipUnless(BROWSER, "no chromium here; bash setup.sh test installs chromium-headless-shell")
class Browser(unittest.TestCase):
    def open(self, page):
        """(the document after its scripts have run, what the browser logged: errors of the page, requests)."""
        with tempfile.TemporaryDirectory() as folder:
            file, net = Path(folder) / "page.html", Path(folder) / "net.json"
            file.write_text(page)
            done = subprocess.run([BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--host-resolver-rules=MAP * ~NOTFOUND",
                                   "--enable-logging=stderr", f"--log-net-log={net}", f"--user-data-dir={folder}/profile",
                                   "--disable-background-networking", "--disable-component-update",
                                   "--virtual-time-budget=5000", "--dump-dom", file.as_uri()], capture_output=True, text=True, timeout=120)
            log = net.read_text() if net.exists() else ""
            return done.stdout, [line for line in done.stderr.splitlines() if "CONSOLE" in line], re.findall(r'"url":"(https?:[^"]*)"', log)

    def test_it_opens_without_errors_and_requests(self):
        Page.setUpClass()
        document, errors, requests = self.open(Page.page)
        self.assertEqual((errors, requests), ([], []))
        for part in ('<p id="errors"></p>', '<span id="step">step 10, time 1 s', 'id="map-strain_invariant"', "<svg"):
            self.assertIn(part, document)
        ends = re.search(r'id="map-porosity".*?<span>([\d.]+)</span><span>([\d.]+)</span>', document, re.S)
        self.assertAlmostEqual(float(ends[1]), 0.435, delta=0.01)
        self.assertAlmostEqual(float(ends[2]), 2.365, delta=0.01)

    def test_a_fault_and_a_request_are_seen(self):
        Page.setUpClass()
        document, errors, _ = self.open(Page.page.replace('"nodes": [[', '"knots": [['))
        self.assertIn("This page has a fault", document)
        self.assertTrue(errors)
        _, errors, requests = self.open(Page.page.replace("</body>", '<img src="http://example.invalid/x.png"></body>'))
        self.assertTrue(errors or requests)


if __name__ == "__main__":
    unittest.main()

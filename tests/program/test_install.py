"""The installed program: moved, read-only, another user, another folder, without the source tree.

    test_install.py CMAKE BUILD SOURCE
"""

import os
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

CMAKE, BUILD, SOURCE = sys.argv[1], Path(sys.argv[2]).resolve(), Path(sys.argv[3]).resolve()
ROOT = os.geteuid() == 0
#: What hides source and build tree from what runs behind it, and makes it another user.
ALONE = ["unshare", "-m", "sh", "-c", f'mount -t tmpfs none "{SOURCE}" && mount -t tmpfs none "{BUILD}" 2>/dev/null; '
         'exec setpriv --reuid=65534 --regid=65534 --clear-groups "$@"', "sh"]
CASES = {"case.toml": SOURCE / "tests/program/small.toml", "law.toml": SOURCE / "tests/program/batch_law.toml"}


def can_hide():
    return ROOT and subprocess.run([*ALONE, "true"], capture_output=True).returncode == 0


class Installed(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = Path(tempfile.mkdtemp(prefix="femxdem_install_"))
        cls.addClassCleanup(shutil.rmtree, cls.folder, ignore_errors=True)
        first, cls.prefix, cls.home = cls.folder / "first", cls.folder / "moved here", cls.folder / "work"
        subprocess.run([CMAKE, "--install", BUILD, "--prefix", first], check=True, stdout=subprocess.DEVNULL)
        first.rename(cls.prefix)
        cls.home.mkdir()
        for name, file in CASES.items():
            shutil.copy(file, cls.home / name)
        cls.folder.chmod(0o755)
        cls.home.chmod(0o777)
        subprocess.run(["chmod", "-R", "a-w", cls.prefix], check=True)
        cls.alone = ALONE if can_hide() else []

    @classmethod
    def run_it(cls, *command, **env):
        """(exit status, what it said) of a command in another folder, by a bare environment."""
        environment = {"PATH": f"{cls.prefix}/bin:/usr/bin:/bin", **env}
        done = subprocess.run([*cls.alone, *map(str, command)], cwd=cls.home, env=environment, capture_output=True, text=True, timeout=300)
        return done.returncode, done.stdout + done.stderr

    def test_version_finds_yade_by_the_scripts_of_the_prefix(self):
        status, said = self.run_it("femxdem", "--version")
        self.assertEqual(status, 0, said)
        self.assertIn(f"scripts      {self.prefix}/lib/femxdem/yade_scripts\n", said)
        self.assertRegex(said, r"yade +20")
        self.assertNotIn("missing", said)

    def test_a_run_and_its_tools(self):
        status, said = self.run_it("femxdem", "run", "case.toml", "--out", "out", "--set", "control.end_time=0.3", "--set", "output.every=1")
        self.assertEqual(status, 0, said)
        self.assertIn("equal YADE's to the bit", said)
        for tool, wanted in (("plot", "curve.png"), ("report", "report.html")):
            status, said = self.run_it("femxdem", tool, "out")
            self.assertEqual(status, 0, said)
            self.assertTrue((self.home / "out" / wanted).stat().st_size > 5000, said)
        status, said = self.run_it("femxdem", "band", "out")
        self.assertEqual((status, said.startswith("femxdem band: no band") or "thickness" in said), (2 if "no band" in said else 0, True), said)
        self.assertEqual(self.run_it("femxdem", "plot", "nowhere")[0], 2)
        status, said = self.run_it("femxdem", "ve", "inspect", "case.toml", "--out", "seen")
        self.assertEqual(status, 0, said)

    def test_the_module_for_python(self):
        code = "import femxdem; print(femxdem.run('law.toml', 'law').curve().of, femxdem.FOLDER)"
        for folder in ("lib/femxdem", "lib/python3.11/dist-packages"):
            status, said = self.run_it("/usr/bin/python3", "-c", code, PYTHONPATH=f"{self.prefix}/{folder}")
            self.assertEqual(status, 0, said)
            self.assertIn(f"{self.prefix}/lib/femxdem", said)

    def test_yade_elsewhere(self):
        elsewhere = self.home / "my yade"
        elsewhere.mkdir(mode=0o755, exist_ok=True)
        status, said = self.run_it("femxdem", "ve", "prepare", "case.toml", FEMXDEM_YADE_DIR=str(elsewhere))
        self.assertEqual((status, f"No YADE in {elsewhere}" in said), (2, True), said)

    def test_completion(self):
        script = self.prefix / "share/bash-completion/completions/femxdem"
        for words, expected in (("re", ["report"]), ("ve pa", ["path"]), ("run --rest", ["--restart"]), ("run x.toml --set ve.sph", ["ve.spheres="]),
                                ("run cas", ["case.toml"]), ("", None)):
            line = ["femxdem", *words.split()] if words else ["femxdem", ""]
            code = f'. "{script}"; COMP_WORDS=({" ".join(w or chr(39) * 2 for w in line)}); COMP_CWORD={len(line) - 1}; _femxdem; printf "%s\\n" "${{COMPREPLY[@]}}"'
            status, said = self.run_it("bash", "-c", code)
            self.assertEqual(status, 0, said)
            if expected is None:
                self.assertLessEqual({"run", "check", "parameters", "ve", "plot", "band", "report", "--version"}, set(said.split()))
            else:
                self.assertEqual(said.split(), expected)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=2)

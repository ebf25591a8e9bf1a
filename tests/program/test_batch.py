"""The program as batch systems run it: two jobs in one folder, full disks, closed descriptors, restarts, odd files.

    test_batch.py FEMXDEM CASES      FEMXDEM: the executable; CASES: the folder with batch.toml
"""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "validation" / "cluster"))
sys.dont_write_bytecode = True

from making_steps import steps_in, wait_for_steps
from same_results import differences

FEMXDEM, CASES = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve()
FOLDER = Path(tempfile.mkdtemp(prefix="femxdem_batch_"))
LAW, GRAINS = CASES / "batch_law.toml", CASES / "batch_grains.toml"
CACHE = ["--set", f've.cache="{FOLDER / "packings"}"']


def run(*arguments, cwd=FOLDER, shell="", env=None, program="run"):
    """(exit status, what it said); `shell` is put behind the command."""
    command = " ".join(f"'{a}'" for a in (FEMXDEM, *program.split(), *arguments)) + " " + shell
    done = subprocess.run(command, shell=True, cwd=cwd, env=env, capture_output=True, text=True, timeout=300)
    return done.returncode, done.stdout + done.stderr


class TwoJobs(unittest.TestCase):
    def test_the_second_is_refused_while_the_first_lives_and_a_killed_one_is_followed(self):
        arguments = [str(FEMXDEM), "run", str(LAW), "--out", "mix", "--overwrite"]
        slow = ["--set", "control.step=1e-5", "--set", "control.max_step=1e-5"]
        first = subprocess.Popen(arguments + slow, cwd=FOLDER, stdout=subprocess.DEVNULL)
        wait_for_steps(first, FOLDER / "mix", 1)
        status, said = run(LAW, "--out", "mix", "--overwrite")
        self.assertEqual(status, 2)
        self.assertIn(f"process {first.pid} on", said)
        self.assertIsNone(first.poll())
        first.kill()
        first.wait()
        status, said = run(LAW, "--out", "mix", "--overwrite")
        self.assertEqual(status, 0, said)
        self.assertIn("taken over", said)
        self.assertFalse((FOLDER / "mix/running.lock").exists())


class ToldToEnd(unittest.TestCase):
    STEPS = ["--set", "control.end_time=0.2", "--set", "control.step=1e-3", "--set", "control.max_step=1e-3",
             "--set", "output.checkpoint_every=0"]

    def start(self, *arguments):
        return subprocess.Popen([str(FEMXDEM), "run", str(LAW), *self.STEPS, *arguments], cwd=FOLDER,
                                stdout=subprocess.PIPE, text=True)

    def test_it_saves_ends_with_75_and_goes_on_as_if_nothing_had_been(self):
        self.assertEqual(run(LAW, *self.STEPS, "--out", "untold")[0], 0)
        for number, name in enumerate((signal.SIGTERM, signal.SIGINT, signal.SIGUSR1, signal.SIGHUP)):
            before = steps_in(FOLDER / "told")
            job = self.start("--out", "told", "--restart" if number else "--overwrite")
            wait_for_steps(job, FOLDER / "told", 8, before)
            job.send_signal(name)
            said = job.communicate(timeout=20)[0]
            self.assertEqual(job.returncode, 75, said)
            self.assertIn(f"stopped: {name.name}: stopped and saved after step", said)
            self.assertFalse((FOLDER / "told/running.lock").exists())
            self.assertEqual(json.loads((FOLDER / "told/summary.json").read_text())["status"], "stopped")
        status, said = run(LAW, *self.STEPS, "--out", "told", "--restart")
        self.assertEqual(status, 0, said)
        self.assertEqual(differences(FOLDER / "untold", FOLDER / "told"), [])

    def test_it_ends_before_its_time_is_over(self):
        slow = ["--set", "control.step=1e-5", "--set", "control.max_step=1e-5", "--set", "output.every=1000"]
        for arguments, env in ((["--time-limit", "0:07"], {}), ([], {"SLURM_JOB_END_TIME": str(int(time.time()) + 8)})):
            start = time.monotonic()
            status, said = run(LAW, "--out", "limit", "--overwrite", *slow, *arguments, env={**os.environ, **env})
            self.assertEqual(status, 75, said)
            self.assertLess(time.monotonic() - start, 7)
            self.assertIn("s of its time are left: stopped and saved after step", said)
        status, said = run(LAW, "--out", "limit", "--restart", "--time-limit", "1h")
        self.assertEqual((status, "--time-limit '1h': is no duration" in said), (2, True), said)

    def test_checkpoints_by_minutes(self):
        minutes = ["--set", "output.checkpoint_minutes=1e-9"]
        self.assertEqual(run(LAW, "--out", "minutes", *minutes, "--set", "output.checkpoint_every=0")[0], 0)
        log = (FOLDER / "minutes/log.txt").read_text()
        self.assertEqual(log.count("checkpoint after step"), 20)


@unittest.skipUnless(os.geteuid() == 0, "a small file system can only be mounted by root")
class FullDisk(unittest.TestCase):
    def small_disk(self, size):
        place = Path(tempfile.mkdtemp(prefix="femxdem_disk_"))
        mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}k", "none", str(place)], capture_output=True)
        if mounted.returncode != 0:
            self.skipTest(f"no tmpfs can be mounted here: {mounted.stderr.decode().strip()}")
        self.addCleanup(subprocess.run, ["umount", "-l", str(place)])
        return place

    def test_one_sentence_with_reason_and_last_whole_step(self):
        import h5py

        for size in (20, 60, 100, 150, 200, 300, 400, 600):
            with self.subTest(size=size):
                place = self.small_disk(size)
                status, said = run(LAW, "--out", place / "o")
                self.assertEqual(status, 5, said)
                last = said.strip().splitlines()[-1]
                self.assertIn("No space left on device", last)
                self.assertRegex(last, "the last whole step is [0-9]+|no step has been made")
                for step in ("checkpoint.h5", "results.h5"):
                    if (place / "o" / step).exists() and (place / "o" / step).stat().st_size > 1000:
                        with h5py.File(place / "o" / step) as h5:  # whole
                            h5.visititems(lambda name, item: item[()] if hasattr(item, "shape") else None)

    def test_room_made_a_restart_equals_the_uninterrupted_run(self):
        self.assertEqual(run(LAW, "--out", "whole")[0], 0)
        place = self.small_disk(700)
        status, said = run(LAW, "--out", place / "o")
        self.assertEqual(status, 5, said)
        self.assertIn("--restart goes on from the checkpoint after step", said)
        subprocess.run(["mount", "-o", "remount,size=20m", str(place)], check=True)
        status, said = run(LAW, "--out", place / "o", "--restart")
        self.assertEqual(status, 0, said)
        cut = lambda text: [line.rsplit(",", 2)[0] for line in text.splitlines()]
        self.assertEqual(cut((place / "o/history.csv").read_text()), cut((FOLDER / "whole/history.csv").read_text()))


class Environments(unittest.TestCase):
    def test_closed_descriptors_and_an_empty_environment(self):
        short = ["--set", "control.end_time=0.02", "--overwrite", *CACHE]
        for shell in ("<&-", ">&-", "2>&-", "<&- >&- 2>&-"):
            self.assertEqual(run(GRAINS, "--out", "closed", *short, shell=shell)[0], 0, shell)
        for env in ({k: v for k, v in os.environ.items() if k != "HOME"}, {"PATH": "/usr/bin:/bin"}):
            status, said = run(GRAINS, "--out", "bare", *short, env=env)
            self.assertEqual(status, 0, said)

    def test_no_escape_codes_under_mpirun(self):
        command = ["mpirun", "--allow-run-as-root", "-n", "1", str(FEMXDEM), "run", str(LAW), "--out", "batch"]
        said = subprocess.run(command, cwd=FOLDER, capture_output=True, timeout=100, env={**os.environ, "TERM": "xterm"}).stdout
        self.assertNotIn(b"\033", said)
        self.assertIn(b"step    2", said)

    def terminal(self, *flags, **env):
        """What a terminal gets of a short run."""
        ours, theirs = os.openpty()
        command = [str(FEMXDEM), "run", str(LAW), "--out", "progress", "--overwrite", "--set", "control.end_time=0.06", *flags]
        environment = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_", "SLURM_"))}
        subprocess.run(command, cwd=FOLDER, stdout=theirs, timeout=100, env={**environment, "TERM": "xterm", **env}, check=True)
        os.close(theirs)
        said = b""
        try:
            while more := os.read(ours, 100000):
                said += more
        except OSError:  # nobody writes to it any more
            os.close(ours)
        return said

    def test_progress_is_one_line_on_a_terminal_of_a_person_or_where_asked(self):
        for flags, env, updates in (((), {}, True), ((), {"SLURM_JOB_ID": "7"}, False), (["--no-progress"], {}, False),
                                    (["--progress"], {"SLURM_JOB_ID": "7"}, True), ((), {"TERM": "dumb"}, False)):
            said = self.terminal(*flags, **env)
            self.assertEqual(b"\033[K\rstep    3" in said, updates, (flags, env))
            self.assertEqual(b"\nstep    3" in said, not updates, (flags, env))
            self.assertIn(b"left 0 s", said)


class Restarts(unittest.TestCase):
    def test_keys_that_differ_and_a_later_end(self):
        self.assertEqual(run(LAW, "--out", "r", "--set", "control.end_time=0.1")[0], 0)
        status, said = run(LAW, "--out", "r", "--restart", "--set", "material.young=6e7", "--set", "control.end_time=0.1")
        self.assertEqual(status, 2)
        self.assertIn("material.young (50000000.0, now 60000000.0)", said)
        status, said = run(LAW, "--out", "r", "--restart", "--set", "control.end_time=0.2")
        self.assertEqual(status, 0, said)
        self.assertEqual((FOLDER / "r/history.csv").read_text().splitlines()[-1].split(",")[0], "10")


class Packings(unittest.TestCase):
    def prepare(self, *arguments):
        return run(GRAINS, *arguments, *CACHE, program="ve prepare")

    def test_a_damaged_packing_is_made_anew(self):
        status, said = self.prepare()
        self.assertEqual(status, 0, said)
        state = next((FOLDER / "packings").glob("*.state"))
        whole = state.read_bytes()
        flipped = bytearray(whole)
        flipped[len(whole) // 2] ^= 1
        for damaged in (whole[:1000], bytes(flipped), b""):
            state.write_bytes(damaged)
            status, said = self.prepare()
            self.assertEqual(status, 0, said)
            self.assertIn(f"{state} is damaged; made anew", said)
            self.assertNotIn("damaged", self.prepare()[1])

    def test_folders_that_cannot_be(self):
        status, said = run(LAW, "--out", "a" * 300)
        self.assertEqual((status, "File name too long" in said), (2, True), said)
        status, said = run(GRAINS, "--set", 've.cache="/proc/packings"', program="ve prepare")
        self.assertEqual((status, "the packing cannot be stored" in said), (2, True), said)

    def test_scripts_that_raise_systemexit_in_a_hook_or_are_not_at_rest(self):
        script = (CASES / "../cases/scripts/triaxial.py").resolve().read_text()
        places = {
            "material": "FrictMat(young=5e7, poisson=.4, frictionAngle=radians(20), density=2600)", "bodies": "",
            "geometry": "Ig2_Sphere_Sphere_ScGeom", "physics": "Ip2_FrictMat_FrictMat_FrictPhys()",
            "law": "Law2_ScGeom_FrictPhys_CundallStrack()", "step": ".5 * PWaveTimeStep()", "ready": "raise SystemExit(3)",
            "run": "O.run(60000, True)", "end": ""}
        case = ["--set", 've.source="script"', "--set", f've.script="{FOLDER / "theirs.py"}"', "--set", "ve.script_steps=70000"]
        (FOLDER / "theirs.py").write_text(script.format(**places))
        status, said = self.prepare(*case)
        self.assertEqual((status, "the script called exit in one of its hooks" in said), (0, True), said)
        (FOLDER / "theirs.py").write_text(script.format(**{**places, "ready": "O.pause()", "run": "O.run(5500, True)"}))
        status, said = self.prepare(*case)
        self.assertEqual((status, "is not at rest as it was made: unbalanced force" in said), (2, True), said)

    def test_inspect_wants_a_case_or_a_state(self):
        (FOLDER / "mine.py").write_text("O.periodic = True\n")
        (FOLDER / "bad.state").write_bytes(b"nothing of YADE")
        for name, reason in (("mine.py", "neither a case"), ("bad.state", "is not a whole volume element")):
            status, said = run(name, program="ve inspect")
            self.assertEqual((status, reason in said, "Traceback" in said), (2, True, False), said)

    def test_the_comparison_is_in_the_manifest(self):
        status, said = self.prepare("--compare", "25", "--out", "compared")
        self.assertEqual(status, 0, said)
        self.assertIn('"continuation": {"steps": 25,', said)
        self.assertTrue(list((FOLDER / "compared").glob("*.state")))


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=2)

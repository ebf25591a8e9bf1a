"""The program as its users run it, on real volume elements: ranks, restart, killed processes, exit statuses.

    test_program.py FEMXDEM CASE      FEMXDEM: the executable; CASE: a small case on volume elements
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

import h5py
import numpy as np

FEMXDEM, CASE = Path(sys.argv[1]), Path(sys.argv[2])
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "validation" / "cluster"))
sys.dont_write_bytecode = True

from making_steps import steps_in, wait_for_steps
from same_results import OF_THE_CLOCK, differences
from same_results import rows as history

FOLDER = tempfile.TemporaryDirectory(prefix="femxdem_program_")
CACHE = Path(FOLDER.name) / "packings"
IN_ORDER = ("--set", "ve.sorted_contacts=true")  # sums of forces have the bits of compact cells
YADE = ("--set", 've.engine="yade"')  # whose trials are processes
MANY_STEPS = ("--set", "control.step=0.003", "--set", "control.max_step=0.003")  # 200, of 10 ms: time to strike a run at work


def command(out, *arguments, ranks=1):
    mpirun = ["mpirun", "--oversubscribe", "-n", str(ranks)]
    if os.geteuid() == 0:
        mpirun.insert(1, "--allow-run-as-root")
    return mpirun + [str(FEMXDEM), "run", str(CASE), "--out", str(out), "--set", f've.cache="{CACHE}"', *arguments]


def run(name, *arguments, ranks=1):
    """Runs the case into a folder of its own; (folder, exit status, what it said)."""
    out = Path(FOLDER.name) / name
    done = subprocess.run(command(out, *arguments, ranks=ranks), capture_output=True, text=True, timeout=600)
    return out, done.returncode, done.stdout + done.stderr


def fields(out):
    """{path: values} of the last step's points, without what depends on the clock."""
    with h5py.File(out / "results.h5") as h5:
        last = h5["steps"][max(h5["steps"])]["points"]
        return {name: last[name][()] for name in last if name not in OF_THE_CLOCK}


def engine(out):
    """Which engine the run had."""
    return json.loads((out / "summary.json").read_text())["engine"]


def workers():
    """{pid: parent} of all worker processes of this executable that still run."""
    found = {}
    for entry in Path("/proc").iterdir():
        try:
            if entry.name.isdigit() and os.readlink(entry / "exe") == str(FEMXDEM.with_name("femxdem-worker").resolve()):
                fields = (entry / "stat").read_text().rsplit(")", 1)[1].split()
                if fields[0] != "Z":
                    found[int(entry.name)] = int(fields[1])
        except OSError:
            continue
    return found


def below(processes, ancestor):
    """Of {pid: parent}, those that descend from the process `ancestor`."""
    mine = {ancestor}
    for _ in range(8):
        mine |= {pid for pid, parent in processes.items() if parent in mine}
    return mine - {ancestor}


def is_program(pid):
    try:
        return os.readlink(f"/proc/{pid}/exe") == str(FEMXDEM.resolve())
    except OSError:  # it has just ended
        return False


def ranks_of(mpirun):
    """Processes of the program that this mpirun has started; none once it has ended."""
    try:
        children = Path(f"/proc/{mpirun.pid}/task/{mpirun.pid}/children").read_text().split()
    except OSError:
        return []
    return [int(pid) for pid in children if is_program(pid)]


class Program(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder, status, said = run("reference")
        assert status == 0, said
        cls.reference = history(cls.folder)
        cls.many_steps, status, said = run("many_steps", *MANY_STEPS)
        assert status == 0, said

    def test_every_file_is_there(self):
        for name in ("results.h5", "results.xdmf", "history.csv", "summary.json", "case.toml", "log.txt", "checkpoint.h5"):
            self.assertTrue((self.folder / name).stat().st_size > 0, name)
        summary = json.loads((self.folder / "summary.json").read_text())
        self.assertEqual((summary["status"], summary["exit_status"], summary["steps"]), ("done", 0, 6))
        self.assertIn("yade", summary["versions"])
        self.assertEqual([row["step"] for row in self.reference], ["1", "2", "3", "4", "5", "6"])

    def test_2_and_4_ranks_give_the_same_bits(self):
        for ranks in (2, 4):
            out, status, said = run(f"ranks{ranks}", ranks=ranks)
            self.assertEqual(status, 0, said)
            self.assertEqual(history(out), self.reference)

    def test_both_engines_have_the_same_history(self):
        out, status, said = run("in_yade", *YADE, *IN_ORDER)
        self.assertEqual(status, 0, said)
        self.assertEqual(engine(out), "yade")
        self.assertEqual(history(out), self.reference)
        of_yade, of_compact = (fields(folder) for folder in (out, self.folder))
        self.assertEqual(of_yade.keys(), of_compact.keys())
        for name, values in of_yade.items():
            apart = 1e-12 * max(1, np.abs(values).max())  # some are summed in other orders
            np.testing.assert_allclose(of_compact[name], values, rtol=0, atol=apart, err_msg=name)

    def test_a_run_goes_on_in_the_other_engine_and_on_other_ranks_and_threads(self):
        steps = ("--set", "control.step=0.125", "--set", "control.max_step=0.125")  # whose sums have no round-off
        whole, half = (steps + ("--set", f"control.end_time={end}") for end in (0.75, 0.5))
        out, status, said = run("exact_steps", *whole)
        self.assertEqual(status, 0, said)
        unscaled = lambda out: [row | {"load_factor": ""} for row in history(out)]  # it is the time over that of the end
        expected = unscaled(out)
        settings = {"compact": ("--set", "ve.threads=2"), "yade": YADE + IN_ORDER}
        for before, after, ranks in (("compact", "compact", 3), ("compact", "yade", 2), ("yade", "compact", 2)):
            name = f"{before}_{after}"
            _, status, said = run(name, *half, *(settings["yade"] if before == "yade" else ()))
            self.assertEqual(status, 0, said)
            out, status, said = run(name, *whole, *settings[after], "--restart", ranks=ranks)
            self.assertEqual(status, 0, said)
            self.assertEqual(engine(out), after)
            self.assertEqual(unscaled(out), expected, name)

    def test_killed_rank_leaves_no_worker_and_the_restart_equals_the_uninterrupted_run(self):
        out = Path(FOLDER.name) / "restart"
        mpirun = subprocess.Popen(command(out, *MANY_STEPS, ranks=2), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        wait_for_steps(mpirun, out, 3)
        before = below(workers() | {r: mpirun.pid for r in ranks_of(mpirun)}, mpirun.pid)
        os.kill(ranks_of(mpirun)[0], signal.SIGKILL)
        mpirun.wait(timeout=60)  # it ends the other rank by SIGKILL, a second after the SIGTERM that ranks ignore
        time.sleep(1)
        self.assertEqual(before & workers().keys(), set())
        self.assertLess(steps_in(out), 200)
        _, status, said = run("restart", *MANY_STEPS, "--restart", ranks=2)
        self.assertEqual(status, 0, said)
        self.assertEqual(differences(self.many_steps, out), [])

    def test_told_to_end_by_a_signal_to_all_its_processes_it_goes_on_with_other_ranks(self):
        out, settings = Path(FOLDER.name) / "told", (*MANY_STEPS, "--set", "output.checkpoint_every=0")
        for ranks in (2, 4):  # SIGUSR1 by way of mpirun, then SIGTERM to every process but mpirun
            before, how = steps_in(out), ["--restart"] if ranks == 4 else []
            mpirun = subprocess.Popen(command(out, *settings, *how, ranks=ranks), stdout=subprocess.PIPE,
                                      stderr=subprocess.STDOUT, text=True)
            wait_for_steps(mpirun, out, 3, before)
            if ranks == 2:
                mpirun.send_signal(signal.SIGUSR1)
            else:
                for pid in below(workers() | {r: mpirun.pid for r in ranks_of(mpirun)}, mpirun.pid):
                    os.kill(pid, signal.SIGTERM)
            said = mpirun.communicate(timeout=60)[0]
            self.assertEqual(mpirun.returncode, 75, said)
        self.assertLess(steps_in(out), 200)
        _, status, said = run("told", *settings, "--restart")
        self.assertEqual(status, 0, said)
        self.assertEqual(differences(self.many_steps, out), [])

    def test_a_killed_trial_does_not_change_the_result(self):
        out, remarks = Path(FOLDER.name) / "killed", Path(FOLDER.name) / "remarks.txt"
        yade, status, said = run("yade", *YADE)
        self.assertEqual(status, 0, said)
        with open(remarks, "w") as said:
            mpirun = subprocess.Popen(command(out, *YADE), stdout=subprocess.DEVNULL, stderr=said)
        killed = 0
        while mpirun.poll() is None:
            processes = workers()
            mine = below(processes | {r: mpirun.pid for r in ranks_of(mpirun)}, mpirun.pid)
            trials = [pid for pid in mine if processes.get(pid) in processes]
            if trials and killed < 3 and (out / "history.csv").exists():
                os.kill(trials[0], signal.SIGSEGV)
                killed += 1
                time.sleep(0.2)
            time.sleep(0.005)
        self.assertEqual(mpirun.returncode, 0)
        self.assertGreater(killed, 0)
        self.assertIn("repeated", remarks.read_text())
        self.assertEqual(history(out), history(yade))

    def test_bad_input_ends_with_2(self):
        _, status, said = run("bad", "--set", "ve.frction=0.3")
        self.assertEqual(status, 2)
        self.assertIn("friction", said)
        _, status, said = run("reference")
        self.assertEqual(status, 2)
        self.assertIn("--restart", said)

    def test_no_convergence_ends_with_3_and_names_the_step(self):
        out, status, said = run("tight", "--set", "solver.tolerance=1e-13", "--set", "solver.max_iterations=3",
                                "--set", "control.min_step=0.05")
        self.assertEqual(status, 3, said)
        self.assertEqual(json.loads((out / "summary.json").read_text())["status"], "not converged")
        self.assertIn("step 0", said)

    def test_a_refused_volume_element_ends_with_4(self):
        out, status, said = run("refused", "--set", "ve.max_unbalanced_force=1e-4", "--set", "control.min_step=0.05")
        self.assertEqual(status, 4, said)
        self.assertIn("unbalanced force", said)
        self.assertEqual(json.loads((out / "summary.json").read_text())["exit_status"], 4)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=2)

"""A few injections of validation/faults: every kind that once left something broken, on a closed-form law.

    test_faults.py FEMXDEM CAMPAIGN      FEMXDEM: the executable; CAMPAIGN: validation/faults
"""

import os
import sys
import tempfile
import types
import unittest
from pathlib import Path

FEMXDEM, CAMPAIGN = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve()
sys.path.insert(0, str(CAMPAIGN))
import injections
import run as faults
from injections import Fault, after_rows


class Injections(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory(prefix="femxdem_faults_")
        cls.addClassCleanup(folder.cleanup)
        runs = Path(folder.name)
        cls.place = faults.place_of(types.SimpleNamespace(program=FEMXDEM, runs=runs, cache=f've.cache="{runs}"'))

    def seen(self, name, do, at, **more):
        fault = Fault(name, environment=faults.of_file(self.place, name, do) | {"FAULT_AT": str(at)}, **more)
        return injections.inject(self.place, fault)

    def test_a_kill_within_an_update_of_the_results(self):
        calls = faults.calls(self.place, "results.h5")
        for at in (calls - 1, calls - 4, calls - 8, calls - 40, calls // 2):
            for do in ("KILL", "TEAR"):
                seen = self.seen("results.h5", do, at)
                self.assertEqual((seen["status"], seen["differs"], seen["way"]), (-9, "", "--restart"), seen)
        self.assertFalse(list(self.place.work.glob("struck/*.undo")))

    def test_a_full_disk_within_it(self):
        calls = faults.calls(self.place, "results.h5")
        for at in (calls - 2, calls - 7, calls - 30):
            seen = self.seen("results.h5", "ENOSPC", at)
            # not readable until the restart: unlike a full disk, the fault forbids putting the old bytes back too
            self.assertEqual((seen["status"], seen["differs"], seen["way"]), (5, "", "--restart"), seen)

    def test_a_lock_is_never_half_of_one(self):
        for at in (1, 2):
            seen = self.seen("running.lock", "KILL", at)
            self.assertEqual((seen["status"], seen["differs"]), (-9, ""), seen)

    def test_what_is_taken_away_is_noticed(self):
        for name in ("results.h5", "history.csv"):
            for act in (Path.unlink, lambda file: os.truncate(file, 0)):
                strike = after_rows(3, lambda folder: act(folder / name))
                seen = injections.inject(self.place, Fault(name, settings=("control.step=0.005",), strike=strike, destroys=True))
                self.assertEqual((seen["status"], seen["way"], seen["differs"]), (5, "noticed", ""), seen)
                self.assertRegex(seen["said"], f"{name}: .*has been removed or changed since the run wrote it")

    def test_a_log_is_none(self):
        strike = after_rows(3, lambda folder: (folder / "log.txt").unlink())
        seen = injections.inject(self.place, Fault("log.txt", settings=("control.step=0.005",), strike=strike))
        self.assertEqual((seen["status"], seen["differs"]), (0, ""), seen)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=2)

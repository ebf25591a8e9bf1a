"""Scripts that take too much, or leave things behind: what they are refused with, or what is left out."""

import os
import threading
import time
import unittest
from pathlib import Path
from unittest import mock

from cells import engine, users
from public_cases_test import DEFAULTS, SCRIPT, Scripts


class Limits(Scripts):
    def make(self, limits=(), **changes):
        Path("theirs.py").write_text(SCRIPT.format(**{**DEFAULTS, **changes}))
        return engine().make_template(users("script", os.path.abspath("theirs.py"), script_steps=160_000, **dict(limits)))

    def refused(self, reason, limits=(), **changes):
        with self.assertRaisesRegex(ValueError, reason):
            self.make(limits, **changes)

    def test_memory(self):
        self.refused("failed: MemoryError", bodies="held = bytearray(20 << 30)")
        self.refused("failed: MemoryError", {"script_memory": 0.5}, bodies="held = []\nwhile True: held.append(bytes(1 << 24))")
        bytearray(1 << 32)  # the process has its own limit again

    def test_a_file_that_grows_for_ever(self):
        endless = "with open('big', 'wb') as f:\n    while True: f.write(b'x' * (1 << 20))"
        self.refused("failed: OSError: .*File too large", {"script_output": 20.0}, bodies=endless)
        self.assertLessEqual(Path("big").stat().st_size, 20 << 20)

    def test_gigabytes_of_print_are_cut(self):
        kept, (ours, theirs) = os.dup(1), os.pipe()
        os.dup2(theirs, 1)
        os.close(theirs)
        passed = []

        def read():
            while said := os.read(ours, 1 << 20):
                passed.append(len(said))

        reader = threading.Thread(target=read)
        reader.start()
        try:
            loud = "import os, sys\nprint('y' * 100_000_000)\nsys.stderr.write('e' * 1_000_000)\nos.system('head -c 50000000 /dev/zero')"
            made = self.make({"script_output": 2.0}, bodies=loud)
        finally:
            os.dup2(kept, 1)
            os.close(kept)
        reader.join()
        os.close(ours)
        self.assertLess(sum(passed), 3 << 20)
        self.assertIn("what the script printed after 2 MB was left out", made["manifest"]["notes"])

    def test_what_it_leaves_behind(self):
        here, before = os.getcwd(), os.dup(1)
        os.close(before)
        left = "import threading, time, subprocess\nthreading.Thread(target=time.sleep, args=(1,), daemon=True).start()\n"
        self.make(bodies=left + "os.chdir('/')\nsubprocess.Popen(['sleep', '20'])")
        self.assertEqual(os.getcwd(), here)
        after = os.dup(1)
        os.close(after)
        self.assertEqual(after, before)  # no descriptor is left open

    def test_a_sleep_for_ever(self):
        for forever in ("time.sleep(1000)", "subprocess.run(['sleep', '1000'])", "while True: pass"):
            began = time.monotonic()
            self.refused("made no DEM step in ve.script_seconds = 1 s", {"script_seconds": 1.0}, bodies="import time, subprocess\n" + forever)
            self.assertLess(time.monotonic() - began, 15)

    @unittest.skipIf(os.system("unshare --net true || unshare --user --net true"), "this system does not let a process leave the network")
    def test_no_network(self):
        self.refused("failed: OSError: .*Network is unreachable", bodies="import socket\nsocket.create_connection(('127.0.0.1', 9))")

    def test_a_network_that_stays_is_noted(self):
        with mock.patch("user_scenes.cut_off_network", lambda: False):
            self.assertIn("the script could reach the network", self.make()["manifest"]["notes"][0])

    def test_standard_input_is_empty(self):
        self.refused("failed: EOFError|failed: OSError", bodies="input('how many? ')")


if __name__ == "__main__":
    unittest.main()

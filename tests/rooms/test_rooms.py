#!/usr/bin/python3
"""The arrows of the rooms: a file finds the headers of its own room and of those below it, and no others.

    test_rooms.py COMPILE_COMMANDS.json     as CMake writes it: the command of one file of each room compiles a probe
"""

import json
import shlex
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
COMMANDS = json.loads(Path(sys.argv.pop(1)).read_text())
HEADER = {
    "points": "tensor.hpp", "elements": "mesh.hpp", "output": "history.hpp", "solver": "control.hpp", "case": "case.hpp",
    "run": "problem.hpp", "program": "versions.hpp", "bridge": "straining.hpp",
}  # fmt: skip
BELOW = {
    "points": [], "elements": ["points"], "output": ["points", "elements"], "solver": ["points", "elements"],
    "case": ["points", "elements", "output", "solver"], "run": ["points", "elements", "output", "solver", "case"],
    "program": ["points", "elements", "output", "solver", "case", "run", "bridge"], "bridge": ["points"],
}  # fmt: skip


def folder(room):
    return ROOT / room if room == "bridge" else ROOT / "fe_master" / room


def command_of(room):
    """Folder and words of the compiler's command of a file of the room, without its input and output."""
    target = {"bridge": "bridge", "program": "femxdem_program"}.get(room, f"fe_{room}")
    entry = next(c for c in COMMANDS if f"/{target}.dir/" in c["command"] and ".gch" not in c["command"])
    words = shlex.split(entry["command"])
    words = words[1:] if Path(words[0]).name == "ccache" else words
    at = words.index("-o")
    return entry["directory"], [w for w in words[:at] + words[at + 2 :] if w not in ("-c", entry["file"])]


def compiles(room, header):
    with tempfile.TemporaryDirectory() as scratch:
        probe = Path(scratch) / "probe.cpp"
        probe.write_text(f'#include "{header}"\n')
        where, words = command_of(room)
        done = subprocess.run([*words, "-fsyntax-only", str(probe)], cwd=where, capture_output=True, text=True)
        return done.returncode == 0, done.stderr


class Rooms(unittest.TestCase):
    def test_an_include_against_the_arrows_does_not_compile(self):
        for room, below in BELOW.items():
            for other, header in HEADER.items():
                if other == room or other in below:
                    continue
                with self.subTest(room=room, header=header):
                    good, said = compiles(room, header)
                    self.assertFalse(good, f"{room} finds {other}/{header}")
                    self.assertIn(f"{header}: No such file", said)

    def test_headers_are_there_and_the_rooms_below_are_found(self):
        for room, header in HEADER.items():
            self.assertTrue((folder(room) / header).is_file(), header)
        for room in ("elements", "bridge", "run"):
            good, said = compiles(room, HEADER["points"])
            self.assertTrue(good, said)


if __name__ == "__main__":
    unittest.main()

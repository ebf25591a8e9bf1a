"""The written documents hold what the program says: parameters.md, and the case in the README.

`femxdem check --effective` writes a case that is itself.

usage: test_parameters.py FEMXDEM ROOT
"""

import difflib
import re
import subprocess
import sys
import tempfile
from pathlib import Path


def reference_differs(femxdem, root):
    """Difference between parameters.md and the program's own list, as text; empty where there is none."""
    written = (root / "fe_master" / "program" / "parameters.md").read_text()
    said = subprocess.run([femxdem, "parameters", "--markdown"], check=True, capture_output=True, text=True).stdout
    return "".join(difflib.unified_diff(written.splitlines(True), said.splitlines(True), "parameters.md", "femxdem", n=0))


def mistakes_of_written_cases(femxdem, document):
    """What `femxdem check` says of the cases in a document, each a block of TOML; there is at least one."""
    cases = re.findall(r"```toml\n(.*?)```", document.read_text(), re.DOTALL)
    if not cases:
        return f"{document} holds no case\n"
    said = ""
    with tempfile.TemporaryDirectory() as folder:
        for text in cases:
            case = Path(folder) / "case.toml"
            case.write_text(text)
            checked = subprocess.run([femxdem, "check", case], capture_output=True, text=True)
            if checked.returncode != 0:
                said += f"{document}: {checked.stderr or checked.stdout}\n"
    return said


def effective_differs(femxdem, case):
    """Difference between the effective case and its own effective case, as text."""
    say = lambda file: subprocess.run([femxdem, "check", "--effective", file], check=True, capture_output=True, text=True).stdout
    with tempfile.TemporaryDirectory() as folder:
        written = Path(folder) / "effective.toml"
        written.write_text(say(case))
        once, twice = (text.splitlines(True)[1:] for text in (written.read_text(), say(written)))  # the first names the file
    return "".join(difflib.unified_diff(once, twice, "effective", "effective of it", n=0))


if __name__ == "__main__":
    femxdem, root = sys.argv[1], Path(sys.argv[2])
    differences = reference_differs(femxdem, root)
    if differences:
        differences += "make it anew: femxdem parameters --markdown > fe_master/program/parameters.md\n"
    differences += mistakes_of_written_cases(femxdem, root / "README.md")
    differences += effective_differs(femxdem, root / "tests" / "program" / "small.toml")
    sys.exit(differences or None)

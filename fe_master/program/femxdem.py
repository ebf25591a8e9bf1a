"""femxdem from Python: results of runs as arrays, and a volume element that is strained by hand.

    import sys; sys.path.insert(0, "PREFIX/lib/femxdem")       # or build/release; under /usr/local it is found by itself
    import femxdem

    run = femxdem.Results("out/demo")
    run.history["residual"], run.step(50).fields["porosity"]
    with femxdem.VolumeElement("case.toml", {"ve.spheres": 200}) as ve:
        found = ve.follow(gradients)                           # (n, 3, 3) -> stress (n, 3, 3) [Pa], tension positive

Volume elements live in a process `femxdem ve serve` of their own, which answers as a run does, to the bit, compact or in
YADE as the case says. Tensors are (3, 3); stresses Cauchy, tension positive [Pa]; F from the reference configuration.
"""

import json
import subprocess
import sys
import tempfile
from functools import cached_property
from pathlib import Path

import numpy as np

_HERE = Path(__file__)
#: The folder of the program and of its modules: this file is in it, or in a folder of it.
FOLDER = next(f for f in (_HERE.parent, _HERE.resolve().parent, _HERE.resolve().parent.parent) if (f / "femxdem").is_file())
sys.path[:0] = [p for p in (str(FOLDER), str(_HERE.resolve().parent)) if p not in sys.path]

import results  # noqa: E402

_COMPONENTS = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "yz": (1, 2), "zx": (2, 0)}


class FemxdemError(Exception):
    """What the program said."""


class VolumeElementFailed(FemxdemError):
    """A strain that the volume element did not follow; its committed state has not moved."""


def _command(verb, case, overrides, *more):
    words = [str(FOLDER / "femxdem"), *verb.split(), str(case), *map(str, more)]
    for key, value in (overrides or {}).items():
        words += ["--set", f"{key}={json.dumps(value)}"]
    return words


def _call(words):
    done = subprocess.run(words, capture_output=True, text=True)
    if done.returncode:
        raise FemxdemError((done.stderr.strip() or done.stdout.strip()) + f" (exit status {done.returncode})")


class Results:
    """A folder that `femxdem run` or `femxdem ve path` wrote; read when asked for. Raises results.ResultsError."""

    def __init__(self, folder):
        self.folder = Path(folder)

    @cached_property
    def case(self):
        """The effective case as a dictionary."""
        return results.read_case(self.folder)

    @cached_property
    def history(self):
        """Columns of history.csv: name -> (steps,)."""
        return results.read_history(self.folder)

    @cached_property
    def summary(self):
        """summary.json as a dictionary."""
        return json.loads((self.folder / "summary.json").read_text())

    @cached_property
    def mesh(self):
        """nodes (nodes, 2) [m], elements (elements, 8), points (elements, points, 2) [m]."""
        return results.read_mesh(self.folder)

    @property
    def steps(self):
        """Numbers of the output steps."""
        return results.output_steps(self.folder)

    def step(self, number=None):
        """An output step, by default the last: time, displacement (nodes, 2) [m], fields: name -> (elements, points) or
        (elements, points, components)."""
        return results.read_step(self.folder, number)

    def curve(self):
        """strain and stress (steps,) of the specimen, compression positive; `unit`, `of`, `against` say what they are."""
        return results.run_curve(self.folder)

    def tensors(self, quantity):
        """"stress" [Pa], "strain" (logarithmic) or "F" of `femxdem ve path`, (steps, 3, 3)."""
        if quantity == "F":
            return np.array([[self.history[f"F_{i}{j}"] for j in (1, 2, 3)] for i in (1, 2, 3)]).transpose(2, 0, 1)
        tensors = np.empty((len(self.history["step"]), 3, 3))
        for name, (i, j) in _COMPONENTS.items():
            tensors[:, i, j] = tensors[:, j, i] = self.history[f"{quantity}_{name}"]
        return tensors


def run(case, out, overrides=None):
    """Runs a case on one rank to the folder `out`; overrides: {"section.key": value}. Returns its Results."""
    _call(_command("run", case, overrides, "--out", out, "--overwrite"))
    return Results(out)


def run_path(case, out=None, overrides=None):
    """Follows the case's path with one point (`femxdem ve path`), stress-controlled components included. Without `out` the
    files go after they were read."""
    with tempfile.TemporaryDirectory() as temporary:
        found = Results(out or Path(temporary) / "path")
        _call(_command("ve path", case, overrides, "--out", found.folder, "--overwrite"))
        found.case, found.history, found.summary  # noqa: B018
    return found


class VolumeElement:
    """One volume element of a case, in a process of its own; close() or `with` ends it.

    overrides: {"section.key": value}. Raises FemxdemError for a case that the program refuses."""

    def __init__(self, case, overrides=None):
        words = _command("ve serve", case, overrides)
        self._errors = tempfile.TemporaryFile("w+")
        self._process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._errors, text=True,
                                         start_new_session=True)
        try:
            self.fields = self._answer("fields").split()  #: names of what `report` holds
        except FemxdemError:
            self.close()
            raise

    def _answer(self, expected):
        for line in self._process.stdout:
            if line.startswith("= "):
                kind, _, rest = line[2:].rstrip("\n").partition(" ")
                if kind == expected:
                    return rest
                raise VolumeElementFailed(rest)
        status = self._process.wait()
        self._errors.seek(0)
        raise FemxdemError(f"{self._errors.read().strip()} (exit status {status})")

    def _ask(self, question, expected):
        try:
            self._process.stdin.write(question + "\n")
            self._process.stdin.flush()
        except (BrokenPipeError, ValueError):
            pass  # _answer says why it has ended
        return np.array(self._answer(expected).split(), dtype=float)

    def evaluate(self, F, stiffness=False):
        """Strains it from its committed state to F (3, 3). Returns stress (3, 3) [Pa], or with `stiffness` that and Eq. (2),
        (3, 3, 3, 3) [Pa]; `report` holds the rest. Raises VolumeElementFailed."""
        F = np.asarray(F, dtype=float)
        if F.shape != (3, 3):
            raise ValueError(f"F has shape {F.shape}, not (3, 3)")
        words = " ".join(repr(float(f)) for f in F.ravel())
        numbers = self._ask(f"{'stiffness' if stiffness else 'evaluate'} {words}", "answer")
        stress, n = numbers[:9].reshape(3, 3), 9 + len(self.fields)
        self.report = dict(zip(self.fields, numbers[9:n]))
        return (stress, numbers[n:].reshape(3, 3, 3, 3)) if stiffness else stress

    def commit(self):
        """The last strain becomes its state; `report` is now complete: porosity, fabric, ... [SI]."""
        self.report = dict(zip(self.fields, self._ask("commit", "done")))

    def follow(self, gradients):
        """Commits F after F of (n, 3, 3). Returns {"stress": (n, 3, 3) [Pa], name of the report: (n,)}."""
        stresses, reports = [], []
        for F in gradients:
            stresses.append(self.evaluate(F))
            self.commit()
            reports.append(list(self.report.values()))
        columns = np.array(reports).reshape(-1, len(self.fields)).T
        return {"stress": np.array(stresses).reshape(-1, 3, 3), **dict(zip(self.fields, columns))}

    def close(self):
        """Ends its process."""
        self._process.stdin.close()
        self._process.stdout.close()
        self._process.wait()
        self._errors.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

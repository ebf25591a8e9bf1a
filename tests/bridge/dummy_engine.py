"""An engine (yade_scripts/protocol.py) without YADE: for tests of the bridge."""

import os
import pathlib
import pickle
import signal
import sys
import time

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "yade_scripts"))

import mean_stress


class DummyEngine:
    """The protocol on a small-strain isotropic elastic cell.

    spec: youngs_modulus [Pa], poisson_ratio [-], confining_stress [Pa], and for tests of failures
    `fault` = "none" | "segv" | "raise" | "hang", which strikes in a deform that ends beyond the stretch
    `fault_strain` (largest |F - I|). Its time step is halved each time that it is to follow the network.
    """

    DEFAULTS = {
        "youngs_modulus": 1e8,
        "poisson_ratio": 0.25,
        "confining_stress": 1e5,
        "fault": "none",
        "fault_strain": 0.0,
    }
    TIME_STEP = 1e-5

    def __init__(self, report_fields):
        self.report_fields = list(report_fields)
        self.cells = {}

    def versions(self):
        return {"yade": "dummy", "numpy": np.__version__}

    def make_template(self, spec):
        cell = {**self.DEFAULTS, **spec, "F": np.eye(3), "steps": 0, "time_step": self.TIME_STEP}
        return {"state": pickle.dumps(cell), "manifest": {"source": "dummy"}}

    def add(self, state):
        ve = max(self.cells, default=-1) + 1
        self.cells[ve] = pickle.loads(state)
        return ve

    def replace(self, ve, state):
        self.cells[ve] = pickle.loads(state)

    def save(self, ve):
        return pickle.dumps(self.cells[ve])

    def remove(self, ve):
        del self.cells[ve]

    def export_scene(self, state):
        return "it is a dummy"

    def info(self, ve):
        return {
            "time_step": self.cells[ve]["time_step"],
            "time_scale": 1e-3 * np.linalg.det(self.cells[ve]["F"]) ** 50,  # follows the strain, as a pressure does
            "mean_stress": self.cells[ve]["confining_stress"],
        }

    def deform(self, ve, velocity_gradient, steps, sample_every=0, late=0.0, out_mean=None):
        cell = self.cells[ve]
        step = np.eye(3) + np.asarray(velocity_gradient).reshape(3, 3) * cell["time_step"]
        if sample_every > 0:
            out_mean[:] = self._mean(ve, step, steps, sample_every, late)
        cell["F"] = np.linalg.matrix_power(step, steps) @ cell["F"]
        cell["steps"] = steps
        if cell["fault"] != "none" and np.abs(cell["F"] - np.eye(3)).max() > cell["fault_strain"]:
            self._fault(ve, cell["fault"])

    def _mean(self, ve, step, steps, sample_every, late):
        mean, F = mean_stress.MeanStress(steps, late), self.cells[ve]["F"]
        for k in (0, *mean_stress.sampled_steps(steps, sample_every)):
            mean.add(k, self._stress(ve, np.linalg.matrix_power(step, k) @ F))
        return mean.mean()

    def _stress(self, ve, F):
        C = np.empty(81)
        self.stiffness(ve, C)
        strain = (F + F.T) / 2 - np.eye(3)
        return (np.einsum("ijkl,kl->ij", C.reshape(3, 3, 3, 3), strain) - self.cells[ve]["confining_stress"] * np.eye(3)).ravel()

    def follow_network(self, ve):
        self.cells[ve]["time_step"] /= 2

    @staticmethod
    def _fault(ve, kind):
        if kind == "segv":
            os.kill(os.getpid(), signal.SIGSEGV)
        if kind == "hang":
            time.sleep(3600)
        raise RuntimeError(f"dummy cell {ve} failed on purpose (fault = {kind}); choose a smaller step.")

    def stiffness(self, ve, out_stiffness, kind="affine"):
        cell = self.cells[ve]
        E, nu = cell["youngs_modulus"], cell["poisson_ratio"]
        lam, mu, d = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu)), np.eye(3)
        C = lam * np.einsum("ij,kl->ijkl", d, d)
        C += mu * (np.einsum("ik,jl->ijkl", d, d) + np.einsum("il,jk->ijkl", d, d))
        out_stiffness[:] = C.ravel()

    def measure(self, ve, out_stress, out_report, out_stretch):
        cell = self.cells[ve]
        out_stress[:] = self._stress(ve, cell["F"])
        out_stretch[:] = cell["F"].ravel()
        values = {"dem_steps": cell["steps"], "time_step": cell["time_step"], "contacts": 1, "mean_rotation": np.nan}
        out_report[:] = [values.get(name, 0.0) for name in self.report_fields]

    def complete_report(self, ve, out_report):
        out_report[self.report_fields.index("mean_rotation")] = np.linalg.norm(self.cells[ve]["F"] - np.eye(3))

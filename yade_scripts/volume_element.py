"""The engine of protocol.py on YADE: volume elements as resident scenes."""

import math
import time
from datetime import datetime, timezone

import numpy as np

import adoption
import contact_loop
import packing
import yade_modules
from time_step import critical_time_step

DEFAULTS = {"source": "prepare", "time_step_safety": 0.8}


class Engine:
    """See protocol.py. Between two calls every VE rests inside a DEM step, after its contact forces have been found and
    before its spheres are moved: YADE defers a new velocity gradient to that moment, so that stress, cell and positions
    belong together and a trial ends exactly where it was sent."""

    def __init__(self, report_fields):
        self.O = yade_modules.load()
        import yade._utils
        from yade.utils import Matrix3

        self._utils, self._Matrix3 = yade._utils, Matrix3
        self.report_fields = list(report_fields)
        self._free = []
        self._last = {}

    def versions(self):
        return yade_modules.versions()

    def make_template(self, spec):
        started = time.perf_counter()
        spec = {**DEFAULTS, **spec}
        self.O.reset()
        if spec["source"] != "prepare":
            raise ValueError(f"ve.source = \"{spec['source']}\" is unknown: use \"prepare\".")
        packing.prepare(self.O, spec)
        manifest = {"source": spec["source"], **adoption.adopt(self.O)}
        self.O.dt = spec["time_step_safety"] * critical_time_step(self.O, contact_loop.contacts(self.O))
        self._to_forces()
        manifest.update(self._describe(0), versions=self.versions(), seconds=time.perf_counter() - started)
        manifest["made"] = datetime.now(timezone.utc).isoformat(timespec="seconds")
        return {"state": self.O.sceneToString(), "manifest": manifest}

    def add(self, state):
        ve = self._free.pop() if self._free else self.O.addScene()
        self.replace(ve, state)
        return ve

    def replace(self, ve, state):
        self._select(ve)
        O = self.O
        O.stringToScene(state)
        time_step, O.dt = O.dt, 0.0
        O.step()  # YADE stores no forces: finish the step in no time and find them again
        self._to_forces()
        O.dt = time_step
        self._last[ve] = (0, 0.0, 0.0, 0.0)

    def save(self, ve):
        self._select(ve)
        return self.O.sceneToString()

    def remove(self, ve):
        self._select(ve)
        self.O.resetCurrentScene()
        self._free.append(ve)
        del self._last[ve]

    def info(self, ve):
        self._select(ve)
        d = self._describe(ve)
        return {k: d[k] for k in ("time_step", "time_scale", "volume", "spheres", "mean_diameter", "mean_stress")}

    def deform(self, ve, velocity_gradient, steps):
        self._select(ve)
        L = np.asarray(velocity_gradient, dtype=float).reshape(3, 3)
        step = self.O.step
        started = time.perf_counter()
        self.O.cell.velGrad = self._Matrix3(*L.ravel())
        before = time.perf_counter()
        for _ in range(steps):
            step()
        self._to_forces()
        now = time.perf_counter()
        rate = np.linalg.norm(L + L.T) / 2
        self._last[ve] = (steps, now - before, now - started, rate)

    def measure(self, ve, out_stress, out_report, out_stretch):
        started = time.perf_counter()
        self._select(ve)
        s = np.array(self._utils.getStress()).reshape(3, 3)
        out_stress[:] = (0.5 * (s + s.T)).ravel()
        out_stretch[:] = np.array(self.O.cell.trsf).ravel()
        steps, engine_seconds, seconds, rate = self._last[ve]
        values = self._describe(ve)
        values["dem_steps"], values["engine_seconds"] = steps, engine_seconds
        values["inertial_number"] = rate * values["time_scale"]
        values["stress_asymmetry"] = float(np.linalg.norm(s - s.T) / (2 * np.linalg.norm(s)))
        values["seconds"] = seconds + time.perf_counter() - started
        out_report[:] = [values.get(name, 0.0) for name in self.report_fields]

    def stiffness(self, ve, out_stiffness):
        self._select(ve)
        c = contact_loop.contacts(self.O)
        out_stiffness[:] = contact_loop.stiffness(c, self.O.cell.volume).ravel()

    def _select(self, ve):
        if self.O.thisScene != ve:
            self.O.switchToScene(ve)

    def _to_forces(self):
        """From a step's beginning to the contact forces of that step: cell, contacts, not the integrator (the last)."""
        O = self.O
        O.subStepping = True
        for _ in range(len(O.engines)):
            O.step()
        O.subStepping = False

    def _describe(self, ve):
        """Numbers of the current scene."""
        O, u = self.O, self._utils
        pressure = -np.trace(np.array(u.getStress()).reshape(3, 3)) / 3
        diameters = np.array([2 * b.shape.radius for b in O.bodies])
        a, density = diameters.mean(), O.bodies[0].mat.density
        m = O.interactions.countReal()
        return {
            "time_step": O.dt,
            "time_scale": a * math.sqrt(density / pressure) if pressure > 0 else math.inf,
            "volume": O.cell.volume,
            "spheres": len(O.bodies),
            "mean_diameter": a,
            "mean_stress": pressure,
            "porosity": 1 - math.pi / 6 * (diameters**3).sum() / O.cell.volume,
            "coordination": 2 * m / len(O.bodies),
            "contacts": m,
            "unbalanced_force": u.unbalancedForce(),
        }

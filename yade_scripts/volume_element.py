"""The engine of protocol.py on YADE: volume elements as resident scenes."""

import math
import os
import shutil
import time
import zlib
from dataclasses import dataclass
from datetime import datetime, timezone
from operator import methodcaller

import numpy as np

import adoption
import archive_check
import compact_scene
import contact_laws
import contact_loop
import continuation
import forces_at_rest
import mean_stress
import packing
import probing
import rolling
import unit_of_time
import user_scenes
import viscosity
import yade_modules
from time_step import follow_network, set_time_step

DEFAULTS = {"arguments": (), "compare": continuation.FEW_STEPS, "scene_sha256": "", "moments": True}  # of what a case leaves out
END_STRESS = ["end_stress_" + c for c in ("xx", "yy", "zz", "xy", "yz", "zx")]


@dataclass
class _Trial:
    """The last deform of a VE."""

    steps: int = 0
    engine_seconds: float = 0.0
    seconds: float = 0.0
    rate: float = 0.0  # norm of the strain rate [1/s]


@dataclass
class _Grains:
    """What does not change while a VE lives."""

    count: int
    radius: np.ndarray  # (bodies,) [m]; 0 for a clump
    solid_volume: float  # [m^3]
    mean_diameter: float  # [m]
    density: float  # [kg/m^3]
    unit: unit_of_time.UnitOfTime  # of the scene
    clumped: bool
    states: list  # YADE's objects with positions and rotations
    new_adhesion: tuple | None  # (f_c [N], friction) that contacts formed later get
    in_order: bool  # sums run over the contacts as in compact cells


class Engine:
    """See protocol.py. Between two calls every VE rests inside a DEM step, after its contact forces have been found and
    before its spheres are moved: YADE defers a new velocity gradient to that moment, so that stress, cell and positions
    belong together and a trial ends exactly where it was sent."""

    def __init__(self, report_fields):
        self.O = yade_modules.load()
        import yade._utils
        from yade.utils import Matrix3

        self._utils, self._Matrix3 = yade._utils, Matrix3
        self._temporary = os.path.dirname(self.O.tmpFilename())  # YADE's in /tmp, which who is killed would leave there
        shutil.rmtree(self._temporary, ignore_errors=True)
        self.report_fields = list(report_fields)
        self._free, self._trial, self._grains = [], {}, {}  # scene 0 is where templates are made

    def versions(self):
        return yade_modules.versions()

    def make_template(self, spec):
        started = time.perf_counter()
        spec = {**DEFAULTS, **spec}
        notes, inputs = self._make_scene(spec)
        manifest = {"source": spec["source"], "notes": notes, "inputs": sorted(inputs.items())}
        manifest["moments"] = rolling.pass_moments(self.O)
        if manifest["moments"] and not spec["moments"]:
            rolling.take_moments(self.O)
        adoption.finish_step(self.O)
        archive_check.refuse_lost_grains(self.O)
        left = archive_check.state(self.O) if self.O.periodic and self.O.interactions.countReal() else None
        own, itself = self.O.dt, continuation.own(self.O)
        try:
            manifest.update(adoption.adopt(self.O))
            manifest["time_step_from"] = set_time_step(self.O, own, spec["time_step_safety"])
            contact_laws.to_forces(self.O)
            archive_check.refuse_not_finite(self.O, "after its adoption")
            archive_check.refuse_other_forces(self.O)
        except Exception:
            itself.dismiss()
            raise
        grains = _grains(self.O)
        manifest.update(self._scales(grains), **self._equilibrium(grains), **self._contact_network())
        manifest.update(spheres=grains.count, mean_diameter=grains.mean_diameter, volume=self.O.cell.volume)
        manifest["sliding_contacts"], manifest["adhesive_contacts"] = self._contact_states(grains)
        manifest["porosity"] = 1 - grains.solid_volume / self.O.cell.volume
        manifest["scene_unit_of_time"] = grains.unit.seconds(1.0)
        manifest["stress"] = np.array(self._utils.getStress()).ravel().tolist()
        made = archive_check.state(self.O)
        state = self.O.sceneToString()
        manifest["state"] = f"{len(state)}-{zlib.crc32(state):08x}"
        manifest["continuation"], said = self._compare(state, made, itself, spec["compare"], spec["source"] == "prepare")
        notes += archive_check.notes_on_adoption(left, made, manifest["dropped"]) + said
        manifest.update(versions=self.versions(), seconds=time.perf_counter() - started)
        manifest["made"] = datetime.now(timezone.utc).isoformat(timespec="seconds")
        return {"state": state, "manifest": manifest}

    def _compare(self, state, made, itself, steps, settled):
        """Lets the restored `state` go on for some steps beside the scene `itself` (continuation.Copy); the manifest's entry and
        sentences. Raises ValueError where the archive does not give back what was `made` (archive_check.State), or what
        the steps led to."""
        ve = self.add(state)
        try:
            archive_check.refuse_dropped(made, archive_check.state(self.O), self.O, "as it was made")
            info = self.info(ve)
            L = continuation.strain_rate(info["time_scale"], info["time_step"])
            scene_step, scene_L = self.O.dt, self._grains[ve].unit.scene_rate(L)
            self.deform(ve, L, steps)
            adopted = archive_check.state(self.O)
            archive_check.refuse_not_finite(self.O, f"after {steps} steps of a small strain")
            before = self._at_rest() if viscosity.noted(self.O) > 0 else adopted
            self.replace(ve, self.O.sceneToString())  # without its forces: what they are found to be tells what was dropped
            archive_check.refuse_dropped(before, archive_check.state(self.O), self.O, f"after {steps} steps of a small strain")
        except Exception:
            itself.dismiss()
            raise
        finally:
            self.remove(ve)
            self._select(0)
        theirs = itself.ask((scene_step, scene_L, steps))
        strain = float(np.linalg.norm(L)) * info["time_step"] * steps
        return continuation.report(theirs, adopted, steps, strain, settled)

    def _at_rest(self):
        """The current scene's State when its grains stop: dashpots answer to a restored scene as if no contact slid, in the
        one step after a checkpoint (Hertz-Mindlin: 2e-5 of the forces), and are no state."""
        O = self.O
        O.cell.velGrad = self._Matrix3.Zero
        time_step, O.dt = O.dt, contact_laws.resting_time_step(O)
        O.step()
        self._utils.calm()
        contact_laws.to_forces(self.O)
        O.dt = time_step
        return archive_check.state(O)

    def _make_scene(self, spec):
        """Fills the current scene as the case says; sentences on what was special, {file that a script read: hash}."""
        self._select(0)
        self.O.resetThisScene()
        if spec["source"] == "prepare":
            packing.prepare(self.O, spec)
            return [], {}
        if spec["source"] == "scene":
            user_scenes.load_scene(self.O, spec["scene"], spec["scene_sha256"])
            return [], {}
        if spec["source"] == "script":
            limits = [spec["script_" + what] for what in ("steps", "seconds", "memory", "output")]
            os.makedirs(self._temporary, mode=0o700, exist_ok=True)
            try:
                return user_scenes.run_script(self.O, spec["script"], spec["arguments"], *limits)
            finally:
                shutil.rmtree(self._temporary, ignore_errors=True)
        raise ValueError(f"ve.source = \"{spec['source']}\" is unknown: use \"prepare\", \"scene\" or \"script\".")

    def add(self, state):
        ve = self._free.pop() if self._free else self.O.addScene()
        self.replace(ve, state)
        return ve

    def replace(self, ve, state):
        self._select(ve)
        O = self.O
        O.stringToScene(state)
        O.forces.reset(False)  # resetting permanent forces as well crashes YADE where bodies have been erased
        kept = forces_at_rest.Kept(O)
        without = contact_laws.sliding_without_normal_force(O.interactions)
        time_step, O.dt = O.dt, contact_laws.resting_time_step(O)
        O.step()  # YADE stores no forces: finish the step in no time and find them again
        contact_laws.note_restored(O)
        contact_laws.to_forces(O)
        if not kept.put_back(O):
            contact_laws.take_normal_force(O.forces, without)
        O.dt = time_step
        if os.environ.get("FEMXDEM_SORTED_CONTACTS"):
            contact_laws.loop_in_order(O)
        self._trial[ve], self._grains[ve] = _Trial(), _grains(O)

    def save(self, ve):
        self._select(ve)
        return forces_at_rest.saved(self.O)

    def export_scene(self, state):
        ve = self.add(state)
        why_not = compact_scene.covered(self.O)
        exported = why_not or compact_scene.export(self.O)
        self.remove(ve)
        return exported

    def write_back(self, ve, exported):
        self._select(ve)
        compact_scene.write_back(self.O, exported)
        self._trial[ve], self._grains[ve] = _Trial(), _grains(self.O)

    def referee(self, ve, exported, velocity_gradient, steps):
        self.write_back(ve, exported)
        contact_laws.loop_in_order(self.O)
        self.deform(ve, velocity_gradient, steps)
        return compact_scene.export(self.O)

    def remove(self, ve):
        self._select(ve)
        self.O.resetThisScene()
        self._free.append(ve)
        del self._trial[ve], self._grains[ve]

    def info(self, ve):
        self._select(ve)
        return self._scales(self._grains[ve])

    def deform(self, ve, velocity_gradient, steps, sample_every=0, late=0.0, out_mean=None):
        self._select(ve)
        L = np.asarray(velocity_gradient, dtype=float).reshape(3, 3)
        started = time.perf_counter()
        self.O.cell.velGrad = self._Matrix3(*self._grains[ve].unit.scene_rate(L).ravel())
        before = time.perf_counter()
        try:
            if sample_every > 0:
                self._run_sampled(steps, sample_every, late, out_mean, self._grains[ve].new_adhesion)
            else:
                contact_laws.run(self.O, steps, self._grains[ve].new_adhesion)
                contact_laws.to_forces(self.O)
        except RuntimeError as error:
            if "larger than half of the cell" not in str(error):
                raise
            raise RuntimeError(
                "The cell has become too narrow for its largest grains, which could touch one another twice: use more "
                "grains (ve.spheres) for this distortion."
            ) from error
        now = time.perf_counter()
        trial = self._trial[ve]
        trial.steps, trial.engine_seconds, trial.seconds = steps, now - before, now - started
        trial.rate = float(np.linalg.norm(L + L.T)) / 2

    def _run_sampled(self, steps, every, late, out_mean, new_adhesion):
        mean, made = mean_stress.MeanStress(steps, late), 0
        mean.add(0, self._symmetric_stress())
        for step in mean_stress.sampled_steps(steps, every):
            contact_laws.run(self.O, step - made, new_adhesion)
            contact_laws.to_forces(self.O)
            mean.add(step, self._symmetric_stress())
            made = step
        out_mean[:] = mean.mean()

    def _symmetric_stress(self):
        s = self._love_weber()
        return (0.5 * (s + s.T)).ravel()

    def measure(self, ve, out_stress, out_report, out_stretch):
        started = time.perf_counter()
        self._select(ve)
        trial, grains = self._trial[ve], self._grains[ve]
        s = self._love_weber()
        out_stress[:] = end = (0.5 * (s + s.T)).ravel()
        out_stretch[:] = np.array(self.O.cell.trsf).ravel()
        values = self._equilibrium(grains)
        values["porosity"] = 1 - grains.solid_volume / self.O.cell.volume
        values["time_step"] = grains.unit.seconds(self.O.dt)
        values["inertial_number"] = trial.rate * _time_scale(grains, -np.trace(s) / 3)
        values["stress_asymmetry"] = float(np.linalg.norm(s - s.T) / max(2 * np.linalg.norm(s), 1e-300))
        values.update(zip(END_STRESS, end[[0, 4, 8, 1, 5, 6]]))
        values["dem_steps"], values["engine_seconds"] = trial.steps, trial.engine_seconds
        values["seconds"] = trial.seconds + time.perf_counter() - started
        out_report[:] = math.nan
        self._fill(out_report, values)

    def complete_report(self, ve, out_report):
        self._select(ve)
        grains = self._grains[ve]
        values = self._contact_network()
        for name, f in zip(("xx", "yy", "zz", "xy", "yz", "zx"), values.pop("fabric")):
            values["fabric_" + name] = f
        values["mean_rotation"] = _mean_rotation(grains.states)
        values["sliding_contacts"], values["adhesive_contacts"] = self._contact_states(grains)
        self._fill(out_report, values)

    def _fill(self, out_report, values):
        for k, name in enumerate(self.report_fields):
            if name in values:
                out_report[k] = values[name]

    def stiffness(self, ve, out_stiffness, kind="affine"):
        self._select(ve)
        if self._sums_in_order():
            out_stiffness[:] = np.array(compact_scene.cell(self.O).stiffness(kind)).ravel()
            return
        c, volume = contact_loop.contacts(self.O), self.O.cell.volume
        if contact_loop.has_stiffness(self.O, c) and not self._grains[ve].clumped:
            C = contact_loop.stiffness_of_kind(self.O, c, self._grains[ve].radius, volume, kind)
        elif kind == "affine":
            C = probing.stiffness(self.O, self._love_weber)
        else:
            raise RuntimeError(
                f"The {kind} stiffness needs spheres whose contacts know their kn and ks: use ve.stiffness = \"affine\"."
            )
        out_stiffness[:] = C.ravel()

    def follow_network(self, ve):
        self._select(ve)
        if not self._sums_in_order():
            follow_network(self.O)
            return
        cell = compact_scene.cell(self.O)
        cell.follow_network()
        self.O.dt = cell.info()["time_step"] * self._grains[ve].unit.in_a_second

    def _select(self, ve):
        if self.O.thisScene != ve:
            self.O.switchToScene(ve)

    def _sums_in_order(self):
        """Whether the answers of the current scene are to have the bits of compact cells."""
        grains = self._grains.get(self.O.thisScene)
        return grains is not None and grains.in_order

    def _love_weber(self):
        """Stress (3, 3) [Pa], tension positive, slightly asymmetric."""
        if self._sums_in_order():
            return compact_scene.stress(self.O)
        return np.array(self._utils.getStress()).reshape(3, 3)

    def _scales(self, grains):
        """The numbers of protocol.py's info()."""
        pressure = float(-np.trace(self._love_weber()) / 3)
        time_scale = _time_scale(grains, pressure)
        return {"time_step": grains.unit.seconds(self.O.dt), "time_scale": time_scale, "mean_stress": pressure}

    def _equilibrium(self, grains):
        """What a trial is judged by."""
        m = self.O.interactions.countReal()
        unbalanced = self._utils.unbalancedForce()
        return {"contacts": m, "coordination": 2 * m / grains.count, "unbalanced_force": unbalanced}

    def _contact_network(self):
        """What a report says of the contacts beside it, as far as YADE counts it in bulk."""
        per_body = np.array(self._utils.numIntrsOfEachBody())
        backbone = per_body[per_body > 1]
        F = np.array(self._utils.fabricTensor()[0]).reshape(3, 3)
        some = self.O.interactions.countReal() > 0
        return {
            "coordination_backbone": float(backbone.mean()) if len(backbone) else 0.0,
            "fabric": [F[0, 0], F[1, 1], F[2, 2], F[0, 1], F[1, 2], F[2, 0]] if some else [0.0] * 6,
        }

    def _contact_states(self, grains):
        """Sliding and adhesive contacts over all contacts."""
        c = contact_loop.contacts(self.O)
        m = max(len(c.phys), 1)
        sliding = contact_loop.at_coulomb_limit(c, grains.radius).sum()
        return float(sliding) / m, float(contact_loop.adhesive(c).sum()) / m


def _grains(O):
    """Clumps count as one grain of the mass that YADE gives them; the mean diameter is that of the spheres."""
    radius = np.array([getattr(b.shape, "radius", 0.0) for b in O.bodies])
    unit = unit_of_time.of(O)
    scene_density = float(np.mean([b.mat.density for b in O.bodies if not b.isClump]))
    grains = [b for b in O.bodies if not b.isClumpMember]
    solid = sum(b.state.mass for b in grains) / scene_density
    density = unit.density(scene_density)
    clumped = any(b.isClump for b in O.bodies)
    states = [b.state for b in O.bodies]
    new_adhesion = contact_laws.adhesion_of_new_contacts(O)
    diameter = 2 * float(radius[radius > 0].mean())
    in_order = bool(os.environ.get("FEMXDEM_SORTED_CONTACTS")) and not compact_scene.covered(O)
    return _Grains(len(grains), radius, solid, diameter, density, unit, clumped, states, new_adhesion, in_order)


def _mean_rotation(states):
    """Mean angle [rad] that the grains have turned since the reference."""
    return float(np.fromiter(map(methodcaller("norm"), map(methodcaller("rot"), states)), float, len(states)).mean())


def _time_scale(grains, pressure):
    """a sqrt(rho/p) [s]; without pressure no rate is slow."""
    return grains.mean_diameter * math.sqrt(grains.density / pressure) if pressure > 0 else math.inf

"""Volume elements made from dimensionless groups: a periodic cell of spheres under isotropic stress."""

import math

import numpy as np

import compact_scene
import contact_laws
import unit_of_time

LOOSE = 0.3  # solid fraction of the spheres before they touch
MORTON_BITS = 10  # of each coordinate
COMPACTION_DAMPING = 0.3
STRESS_TOLERANCE = 5e-4  # of sigma_0, each component
UNBALANCED_TOLERANCE = 5e-5
ROUGH = 40  # times both tolerances, for a stage that another one follows
ROUGH_STEPS = 10_000  # and no longer than this at kappa = 500: without friction the last rearrangements take very long
MAX_STEPS = 400_000


def prepare(O, spec):
    """Makes the packing in YADE's current scene `O`, isotropic to confining_stress and at rest. `spec` is the whole [ve]
    table of a case, which has checked it: `femxdem parameters` has its units, bounds, and the only defaults.

    Adhesion is put in at sigma_0. A bond changes no force. The adhesive law adds -f_c to every contact; so the radii
    are smaller by f_c/(2 kn) until then, and restoring them moves every overlap by f_c/kn, which balances it.
    The paper's law comes to rest in a compact cell at the end: the scene holds its places, contacts and forces.
    Raises RuntimeError when equilibrium is not reached.
    """
    p = dict(spec)
    unit = unit_of_time.suited(p["confining_stress"], p["density"], p["spheres"])
    unit_of_time.note(O, unit)
    p["density"] = unit.scene_density(p["density"])  # all times and rates of the scene follow from it
    rng = np.random.default_rng(p["seed"])
    paper = p["contact_law"] == contact_laws.PAPER
    if paper:
        p["contact_law"] = "adhesive"  # the nearest that YADE has
    sigma, a, law = p["confining_stress"], p["mean_diameter"], p["contact_law"]
    kn, f_c = p["kappa"] * sigma * a, p["cohesion"] * sigma * a * a
    diameters = rng.uniform(1.0, p["size_ratio"], p["spheres"])
    radii = 0.5 * a * diameters / diameters.mean()
    shrink = 0.5 * f_c / kn if law == "adhesive" else 0.0
    side = (4 / 3 * math.pi * (radii**3).sum() / LOOSE) ** (1 / 3)
    positions = _random_positions(rng, radii, side)
    numbers = _along_mortons_curve(positions / side)
    positions, radii = positions[numbers], radii[numbers]
    _loose_cell(O, p, kn, side, positions, radii - shrink)
    stiffest = kn * max(1, 1 / p["stiffness_ratio"])  # of normal and tangential
    O.dt = 0.2 * math.sqrt(O.bodies[int(np.argmin(radii))].state.mass / stiffest)
    servo = _Servo(O, p, kn)
    servo.compact()
    servo.settle(ROUGH, servo.steps + int(ROUGH_STEPS * math.sqrt(p["kappa"] / 500)))
    contact_laws.set_friction(O.bodies, O.interactions, p["friction"])
    if f_c > 0:
        _set_radii(O, radii, kn, p["density"])
        O.step()
        while contact_laws.add_adhesion(law, O.interactions, f_c, p["friction"]):
            servo.settle(ROUGH)
    servo.settle()
    if paper:
        _settle_papers_law(O, p, kn, f_c)
    if p["new_contacts"] == "adhesive":
        contact_laws.make_new_contacts_adhesive(O, f_c, p["friction"])
    O.engines[-1].damping = p["damping"]
    O.interactions.serializeSorted = True  # contacts come back from a saved scene in the order of the spheres


def _settle_papers_law(O, p, kn, f_c):
    """Brings the packing to rest at sigma_0 under the paper's law, in a compact cell without dashpots; contacts that form
    meanwhile become adhesive. Leaves the scene inside a step, after its contact forces."""
    contact_laws.note_paper_law(O, 0.0)
    contact_laws.to_forces(O)
    servo = _CompactServo(O, p, kn)
    while True:
        servo.settle()
        compact_scene.write_back(O, servo.cell.to_scene())
        if f_c == 0 or not contact_laws.add_adhesion("adhesive", O.interactions, f_c, p["friction"]):
            break
        servo.take_over()
    contact_laws.note_paper_law(O, p["viscous_damping"])


def _loose_cell(O, p, kn, side, positions, radii):
    """Spheres at their positions (n, 3) [m], without contact, in a periodic cube."""
    from yade.utils import Matrix3, sphere

    O.periodic = True
    O.cell.hSize = Matrix3(side, 0, 0, 0, side, 0, 0, 0, side)
    law, kt = p["contact_law"], kn / p["stiffness_ratio"]
    O.engines = contact_laws.engines(law, kn, kt, COMPACTION_DAMPING)
    contact_laws.note_constant_stiffness(O, kn, kt)
    for x, r in zip(positions, radii):
        mat = contact_laws.material(law, kn, kt, r, p["density"], p["compaction_friction"])
        O.bodies.append(sphere(tuple(x), r, material=mat))


def _random_positions(rng, radii, side):
    """Random sequential addition in a periodic cube, the largest first."""
    positions = np.empty((len(radii), 3))
    placed = np.empty(0, dtype=int)
    for i in np.argsort(-radii, kind="stable"):
        while True:
            x = rng.uniform(0, side, 3)
            d = positions[placed] - x
            d -= side * np.round(d / side)
            if (np.einsum("ij,ij->i", d, d) > (radii[placed] + radii[i]) ** 2).all():
                break
        positions[i] = x
        placed = np.append(placed, i)
    return positions


def _along_mortons_curve(x):
    """Order (n,) of points x (n, 3) in the unit cube along Morton's curve (1966): spheres that touch one another later
    have near numbers, and so lie near to one another in memory."""
    cells = (x * 2**MORTON_BITS).astype(np.int64)
    code = np.zeros(len(x), dtype=np.int64)
    for bit in range(MORTON_BITS):
        for axis in range(3):
            code |= (cells[:, axis] >> bit & 1) << 3 * bit + axis
    return np.argsort(code, kind="stable")


def _set_radii(O, radii, kn, density):
    for b, r in zip(O.bodies, radii):
        mass = 4 / 3 * math.pi * r**3 * density
        b.shape.radius = r
        b.mat.young = kn / r
        b.state.mass = mass
        b.state.inertia = (0.4 * mass * r * r,) * 3


class _Servo:
    """Drives the periodic cell, all six components, to the isotropic stress -sigma_0."""

    EVERY = 10  # steps between two looks at the stress

    def __init__(self, O, p, kn):
        from yade._utils import getStress, unbalancedForce

        self.O, self.sigma = O, p["confining_stress"]
        self.stress, self.unbalanced = getStress, unbalancedForce
        shear = max(1, (1 + 1.5 / p["stiffness_ratio"]) / 2.5)  # shear modulus over that of k_n/k_t = 1, Voigt
        self.modulus = 0.4 * kn / p["mean_diameter"] * shear  # of a dense packing: bulk, or more where shear is stiffer
        self.relaxation = 50 * O.dt
        self.rate = 0.02 * math.sqrt(self.sigma / p["density"]) / p["mean_diameter"]  # inertial number 0.02
        self.steps = 0

    def _go(self, rate):
        from yade.utils import Matrix3

        self.O.cell.velGrad = Matrix3(*rate.ravel())
        for _ in range(self.EVERY):
            self.O.step()

    def _strain(self, rate):
        self._go(rate)
        self.steps += self.EVERY
        if self.steps > MAX_STEPS:
            raise RuntimeError(
                f"The packing is not in equilibrium after {MAX_STEPS} steps (unbalanced force {self.unbalanced():.1e}, "
                f"limit {UNBALANCED_TOLERANCE:.0e}): try another ve.seed, a lower ve.kappa or more ve.spheres."
            )

    def error(self):
        """Symmetric stress above the target, over sigma_0."""
        s = np.array(self.stress()).reshape(3, 3)
        return (s + s.T) / (2 * self.sigma) + np.eye(3)

    def compact(self):
        """Isotropic compression of the loose cell until it carries a tenth of sigma_0."""
        while np.trace(self.error()) > 3 * 0.9:
            self._strain(-self.rate * np.eye(3))

    def settle(self, slack=1, last_step=MAX_STEPS + 1):
        """Until the stress is on target and the spheres are at rest, within `slack` times the tolerances, or until
        step `last_step`."""
        while self.steps < last_step:
            e = self.error()
            if np.abs(e).max() < slack * STRESS_TOLERANCE:
                if self.unbalanced() < slack * UNBALANCED_TOLERANCE:
                    break
                e[:] = 0
            rate = -e * self.sigma / (self.modulus * self.relaxation)
            self._strain(np.clip(rate, -self.rate, self.rate))
        self._strain(np.zeros((3, 3)))


class _CompactServo(_Servo):
    """The same for a law that only the compact cell of the scene has."""

    def __init__(self, O, p, kn):
        super().__init__(O, p, kn)
        self.take_over()

    def take_over(self):
        """Goes on from what the scene is now."""
        self.cell = compact_scene.cell(self.O)
        self.stress, self.unbalanced = self.cell.stress, lambda: self.cell.report()["unbalanced_force"]

    def _go(self, rate):
        self.cell.deform(rate * unit_of_time.of(self.O).in_a_second, self.EVERY)

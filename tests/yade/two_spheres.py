"""Two spheres moved by hand in a large periodic cell: what the contact laws do, one step at a time."""

import numpy as np

import compact_scene
import contact_laws
from cells import engine

DIAMETER = 1.0  # [m]; far above the overlaps, so that the contact hardly turns while it slides
KN = 5e4  # [N/m]
F_C = 0.1  # [N]
FRICTION = 0.5
STEP = 1e-7  # [m], a twentieth of f_c/kn


class Pair:
    """A fixed sphere and one at x = DIAMETER - overlap that goes where it is told; `law` as in contact_laws.LAWS.

    new_adhesion: None or (f_c [N], friction) of contacts that form later, see contact_laws.run.
    """

    def __init__(self, law, overlap, kt=KN, new_adhesion=None):
        O = engine().O
        from yade.utils import Matrix3, Vector3, sphere

        O.switchToScene(0)
        O.resetThisScene()
        O.periodic = True
        O.cell.hSize = Matrix3.Identity * (10 * DIAMETER)
        O.engines = contact_laws.engines(law, KN, kt, damping=0.0)
        O.dt = 1e-6
        mat = contact_laws.material(law, KN, kt, DIAMETER / 2, 2600.0, FRICTION)
        for x in (0.0, DIAMETER - overlap):
            O.bodies.append(sphere((x, 0, 0), DIAMETER / 2, material=mat))
            O.bodies[-1].state.blockedDOFs = "xyzXYZ"
        self.O, self.moving, self._vector, self._new_adhesion = O, O.bodies[1], Vector3, new_adhesion
        self._find_forces()
        if law != "friction" and self.contact:
            contact_laws.add_adhesion(law, O.interactions, F_C, FRICTION)
            self.move(0, 0)

    @property
    def contact(self):
        """YADE's interaction, or None when there is no contact."""
        found = [i for i in self.O.interactions if i.isReal]
        return found[0] if found else None

    def move(self, dx, dy):
        """The sphere goes `dx`, `dy` [m] further and the forces there are found (the pair rests inside a step)."""
        self.moving.state.vel = self._vector(dx, dy, 0) / self.O.dt
        contact_laws.run(self.O, 1, self._new_adhesion)
        self._find_forces()

    def _find_forces(self):
        self.O.subStepping = True
        for _ in range(len(self.O.engines)):
            self.O.step()
        self.O.subStepping = False

    @property
    def overlap(self):
        return DIAMETER - (self.moving.state.pos - self.O.bodies[0].state.pos).norm()

    @property
    def normal_force(self):
        """Compression positive [N]; 0 without contact."""
        i = self.contact
        return float(np.dot(i.phys.normalForce, i.geom.normal)) if i else 0.0

    @property
    def shear_force(self):
        i = self.contact
        return i.phys.shearForce.norm() if i else 0.0


class PaperPair:
    """The same under the paper's law, in a compact cell, which moves the sphere by its own deformation."""

    def __init__(self, overlap, new_adhesion=None, viscous_damping=0.0):
        pair = Pair("adhesive", overlap)
        contact_laws.note_paper_law(pair.O, viscous_damping)
        if new_adhesion:
            contact_laws.make_new_contacts_adhesive(pair.O, *new_adhesion)
        self.cell = compact_scene.cell(pair.O)

    def move(self, dx, dy):
        """A pure strain: neither sphere turns, and no velocity is left over."""
        x, y, _ = self._branch
        a, b = np.linalg.solve([[x, y], [0, x]], [dx, dy])
        self.cell.rest()
        self.cell.deform(np.array([[a, b, 0], [b, 0, 0], [0, 0, 0]]) / self.cell.info()["time_step"], 1)

    @property
    def _scene(self):
        return compact_scene.Scene(self.cell.to_scene())

    @property
    def _branch(self):
        x = self._scene.x
        return x[1] - x[0]

    @property
    def contact(self):
        return self.cell.contacts > 0

    @property
    def overlap(self):
        return DIAMETER - np.linalg.norm(self._branch)

    @property
    def normal_force(self):
        return float(self._scene.normal_force[0]) if self.contact else 0.0

    @property
    def shear_force(self):
        return float(np.linalg.norm(self._scene.shear[0])) if self.contact else 0.0


def pair_of(law, overlap, **more):
    return PaperPair(overlap, **more) if law == contact_laws.PAPER else Pair(law, overlap, **more)


def normal_path(law, path, overlap=4e-6, new_adhesion=None, **more):
    """Rows (overlap, normal force, contact?) along `path`, increments of the overlap in STEPs."""
    pair, rows = pair_of(law, overlap, new_adhesion=new_adhesion, **more), []
    for direction in path:
        pair.move(-direction * STEP, 0)
        rows.append((pair.overlap, pair.normal_force, pair.contact is not None))
    return np.array(rows)


def there_and_back(steps):
    return [-1] * steps + [1] * steps


def slide(law, overlap, path, kt=KN):
    """Rows (overlap, normal force, shear force) along `path`, tangential increments in STEPs, and the pair."""
    pair, rows = pair_of(law, overlap, **({} if law == contact_laws.PAPER else {"kt": kt})), []
    for direction in path:
        pair.move(0, direction * STEP)
        rows.append((pair.overlap, pair.normal_force, pair.shear_force))
    return np.array(rows), pair


def sliding_cycle(slip):
    """Path of slide: over `slip` [m] forth, twice back, forth."""
    n = int(slip / STEP)
    return [1] * n + [-1] * 2 * n + [1] * n


def slider(overlaps, path, limit, kt=KN):
    """Closed form (signed) of the shear force along `path`: elastic-plastic in the tangential slip s (which YADE takes at
    touching spheres, s d/(d - delta)): trial kt s, cut at the `limit` of the current overlap."""
    force, forces = 0.0, []
    for most, overlap, direction in zip(limit, overlaps, path):
        trial = force + kt * direction * STEP * DIAMETER / (DIAMETER - overlap)
        force = min(max(trial, -most), most)
        forces.append(force)
    return np.array(forces)

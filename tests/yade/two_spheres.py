"""Two spheres moved by hand in a large periodic cell: what the contact laws do, one step at a time."""

import numpy as np

import contact_laws
from cells import engine

DIAMETER = 1.0  # [m]; far above the overlaps, so that the contact hardly turns while it slides
KN = 5e4  # [N/m]
F_C = 0.1  # [N]
FRICTION = 0.5


class Pair:
    """A fixed sphere and one at x = DIAMETER - overlap that goes where it is told; `law` as in contact_laws.LAWS."""

    def __init__(self, law, overlap, kt=KN):
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
        self.O, self.moving, self._vector = O, O.bodies[1], Vector3
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
        self.O.step()
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

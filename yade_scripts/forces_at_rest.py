"""The forces of a scene at rest, which YADE's archive does not hold.

Found again from the places of the spheres they are right up to round-off: a contact that slides is scaled to its limit once
more, and a bond that has broken in tension ends a step early. So a saved scene carries its forces in a tag, and a restored one
goes on as if it had never been saved.
"""

from base64 import b64decode, b64encode

import numpy as np

import contact_laws
import viscosity

TAG = "femxdem_forces_at_rest"
ENDLESS = 1e300  # [N]
OF_CONTACTS = ("normalForce", "shearForce")  # which a restored scene has, until it finds the forces again


def saved(O):
    """The archive of `O` with its forces; without them for laws whose answer to rest is another (viscosity, Hertz-Mindlin)."""
    if contact_laws.resting_time_step(O) > 0 or viscosity.noted(O) > 0:
        return O.sceneToString()
    forces = [[tuple(of(b.id)) for b in O.bodies] for of in (O.forces.f, O.forces.t)]
    O.tags[TAG] = b64encode(np.array(forces).tobytes()).decode()
    archive = O.sceneToString()
    O.tags[TAG] = ""
    return archive


class Kept:
    """The forces of the scene that has just been restored, whose contacts then hold in any tension until these are put back;
    nothing where it does not carry them."""

    def __init__(self, O):
        noted = O.tags[TAG] if TAG in O.tags.keys() else ""
        self._of_bodies = np.frombuffer(b64decode(noted)).reshape(2, -1, 3) if noted else None
        self._of_contacts = {}
        if not noted:
            return
        O.tags[TAG] = ""
        for i in O.interactions:
            adhesion = getattr(i.phys, "normalAdhesion", None)
            self._of_contacts[i.id1, i.id2] = adhesion, [tuple(getattr(i.phys, name)) for name in OF_CONTACTS]
            if adhesion is not None:
                i.phys.normalAdhesion = ENDLESS

    def put_back(self, O):
        """Whether there was something to put into the scene, whose forces have been found again."""
        if self._of_bodies is None:
            return False
        for i in O.interactions:
            if (i.id1, i.id2) not in self._of_contacts:
                continue  # it forms in the step to come
            adhesion, forces = self._of_contacts[i.id1, i.id2]
            for name, force in zip(OF_CONTACTS, forces):
                setattr(i.phys, name, force)
            if adhesion is not None:
                i.phys.normalAdhesion = adhesion
        O.forces.f(0, True)  # YADE forgets nothing in a reset that it has not summed before
        O.forces.reset(False)
        for b, f, t in zip(O.bodies, *self._of_bodies):
            O.forces.addF(b.id, tuple(f))
            O.forces.addT(b.id, tuple(t))
        return True

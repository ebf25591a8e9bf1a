"""Between YADE's scenes and the compact cell (bridge/compact_cell.hpp), which makes YADE's step over arrays.

Both rest inside a step, after the contact forces and before the integrator (volume_element.Engine). The format of an
export is told in bridge/compact_scene.hpp.
"""

import math
from operator import attrgetter

import numpy as np

import contact_laws
import unit_of_time

LATER = 1 << 62  # a step number after the last look for new contacts, whenever that was
MAGIC = b"fxdscene"
VERSION = 2
COHESIVE, FRICTION, PAPER = 0, 1, 2
LAWS = {
    ("ScGeom6D", "CohFrictPhys", "Law2_ScGeom6D_CohFrictPhys_CohesionMoment"): COHESIVE,
    ("ScGeom", "FrictPhys", "Law2_ScGeom_FrictPhys_CundallStrack"): FRICTION,
}
ENGINES = ["ForceResetter", "InsertionSortCollider", "InteractionLoop", "NewtonIntegrator"]
# What every object of a covered scene says of itself, where it has such an attribute.
FUNCTORS = {
    "interactionDetectionFactor": 1.0,
    "avoidGranularRatcheting": True,
    "creep": False,
    "setCohesionNow": False,
    "setCohesionOnNewContacts": False,
    "frictAngle": None,
    "neverErase": False,
    "sphericalBodies": True,
    "always_use_moment_law": False,
    "shear_creep": False,
    "twist_creep": False,
    "traceEnergy": False,
}
MATERIALS = {"momentRotationLaw": False}
STATES = {"blockedDOFs": "", "isDamped": True}
CONTACTS = {"momentRotationLaw": False, "cohesionDisablesFriction": False, "initCohesion": False}
INTEGRATOR = {"mask": -1, "kinSplit": False}


def covered(O):
    """None, or the sentence why the compact engine does not cover the scene of `O`."""
    names = [type(e).__name__ for e in O.engines]
    if names != ENGINES:
        return f"it runs the engines {', '.join(names)}, and the compact engine knows only {', '.join(ENGINES)}"
    return _functors(O.engines[2]) or _grains(O) or _contacts(O) or _state(O)


def _functors(loop):
    functors = [d.functors for d in (loop.geomDispatcher, loop.physDispatcher, loop.lawDispatcher)]
    if any(len(f) != 1 for f in functors):
        return "its contact loop has several functors for one purpose"
    geometry, physics, law = (f[0] for f in functors)
    kind = _kind(loop)
    if kind not in LAWS:
        names = ", ".join(type(f).__name__ for f in (geometry, physics, law))
        return f"its contacts are made by {names}"
    for functor in (geometry, physics, law):
        wrong = _different(functor, FUNCTORS)
        if wrong:
            return f"{type(functor).__name__}.{wrong}"
    makers = [getattr(physics, name, None) for name in ("kn", "ks")]
    matching = any(m is not None and (m.algo != "val" or m.matches) for m in makers)
    if matching or (makers[0] is None) != (makers[1] is None):
        return f"{type(physics).__name__} matches materials for its stiffnesses"
    return "its contact loop has callbacks" if loop.callbacks else None


def _kind(loop):
    geometry, physics, law = (d.functors[0] for d in (loop.geomDispatcher, loop.physDispatcher, loop.lawDispatcher))
    made = {
        "Ig2_Sphere_Sphere_ScGeom6D": "ScGeom6D",
        "Ig2_Sphere_Sphere_ScGeom": "ScGeom",
        "Ip2_CohFrictMat_CohFrictMat_CohFrictPhys": "CohFrictPhys",
        "Ip2_FrictMat_FrictMat_FrictPhys": "FrictPhys",
    }
    return made.get(type(geometry).__name__), made.get(type(physics).__name__), type(law).__name__


def _grains(O):
    for at, b in enumerate(O.bodies):
        if b.id != at:
            return "some of its bodies have been erased"
        if type(b.shape).__name__ != "Sphere" or b.isClumpMember:
            return f"body {b.id} is not a single sphere"
        wrong = _different(b.state, STATES) or _different(b.mat, MATERIALS)
        if wrong:
            return f"body {b.id} has {wrong}"
        if len(set(b.state.inertia)) != 1:
            return f"body {b.id} has three moments of inertia"
    return None if len(O.bodies) > 1 else "it has a single sphere"


def _contacts(O):
    for i in O.interactions:
        if i.id1 > i.id2:
            return f"the contact of bodies {i.id1} and {i.id2} runs from the later to the earlier"
        wrong = _different(i.phys, CONTACTS)
        if wrong:
            return f"the contact of bodies {i.id1} and {i.id2} has {wrong}"
    return None


def _state(O):
    newton = O.engines[-1]
    wrong = _different(newton, INTEGRATOR)
    if wrong:
        return f"NewtonIntegrator.{wrong}"
    if newton.gravity.norm() != 0 or O.trackEnergy or O.forces.getPermForceUsed():
        return "it has gravity, permanent forces or a record of energies"
    if not O.periodic or O.cell.homoDeform != 2:
        return "its spheres do not follow a periodic cell (Cell.homoDeform is not 2)"
    if O.subStep != len(O.engines) - 1:
        return "it does not rest between its contact forces and its integrator"
    return None


def _different(what, values):
    for name, value in values.items():
        is_now = getattr(what, name, value)
        if is_now != value:
            return f"{name} = {is_now!r}"
    return None


def export(O):
    """Everything of the scene, which covered(O) has found good, as bytes for compact_cell.CompactCell.from_scene."""
    law = LAWS[_kind(O.engines[2])] if contact_laws.paper_law(O) is None else PAPER
    contacts = sorted(O.interactions, key=attrgetter("id1", "id2"))
    safety = contact_laws.time_step_safety(O)
    follows = safety is not None and contact_laws.constant_stiffness(O) is None
    counts = [VERSION, law, len(O.bodies), len(contacts), contact_laws.steps_made(O), int(follows)]
    parts = [np.array(counts, dtype=np.int64), _numbers(O, law, safety if follows else math.nan)]
    parts += _sphere_arrays(O) + _contact_arrays(O, law, contacts)
    if follows:  # of the power iteration, as in time_step.critical_time_step
        parts.append(np.random.default_rng(0).standard_normal((2, len(O.bodies), 3)))
    return MAGIC + b"".join(np.ascontiguousarray(p).tobytes() for p in parts)


def cell(O):
    """The compact cell of a covered scene: it sums in the order of the spheres' numbers, YADE in that of its container."""
    import compact_cell

    return compact_cell.CompactCell.from_scene(export(O))


def stress(O):
    """(3, 3) Cauchy stress [Pa] of a covered scene, slightly asymmetric, with the bits of compact cells (love_weber of
    bridge/compact_report.cpp): the same operations, contacts in the order of the spheres' numbers."""
    contacts = sorted(O.interactions, key=attrgetter("id1", "id2"))
    phys, x = [i.phys for i in contacts], _vectors([b.state for b in O.bodies], "pos")
    i, j = (_scalars(contacts, name).astype(int) for name in ("id1", "id2"))
    H, shift = np.array(O.cell.hSize).reshape(3, 3), np.array([list(c.cellDist) for c in contacts], float).reshape(-1, 3)
    images = H[:, 0] * shift[:, :1] + (H[:, 1] * shift[:, 1:2] + H[:, 2] * shift[:, 2:])
    force, branch = _vectors(phys, "normalForce") + _vectors(phys, "shearForce"), (x[i] - x[j]) - images
    s = np.zeros((3, 3))
    if contacts:  # cumsum adds one after the other
        s = np.cumsum(force[:, :, None] * branch[:, None, :], axis=0)[-1] / O.cell.volume
    return s


def _numbers(O, law, safety):
    newton, cell, physics, unit = O.engines[-1], O.cell, O.engines[2].physDispatcher.functors[0], unit_of_time.of(O).in_a_second
    L = cell.nextVelGrad if cell.velGradChanged else cell.velGrad  # a new one waits for the integrator
    tensors = [np.array(T).ravel() for T in (cell.hSize, cell.trsf)]
    tensors += [unit * np.array(T).ravel() for T in (L, newton.prevVelGrad)]
    new = contact_laws.adhesion_of_new_contacts(O) or (math.nan, math.nan)
    constants = [getattr(physics, name, None) if law == FRICTION else None for name in ("kn", "ks")]
    constants = [math.nan if maker is None else maker.val for maker in constants]
    scene_density = float(np.mean([b.mat.density for b in O.bodies]))
    diameter = 2 * float(np.array([b.shape.radius for b in O.bodies]).mean())
    solid = sum(b.state.mass for b in O.bodies) / scene_density
    last = [safety, scene_density / unit**2, diameter, solid, contact_laws.paper_law(O) or 0.0]
    return np.concatenate([[O.dt / unit, newton.damping], *tensors, new, constants, last])


def _sphere_arrays(O):
    bodies = list(O.bodies)
    states, materials = [b.state for b in bodies], [b.mat for b in bodies]
    forces = [[(list(f(b.id))) for b in bodies] for f in (O.forces.f, O.forces.t)]
    turned, unit = [s.ori * s.refOri.inverse() for s in states], unit_of_time.of(O).in_a_second
    return [
        _vectors(states, "pos"),
        *(unit * _vectors(states, name) for name in ("vel", "angVel")),
        *map(np.array, forces),
        np.array([(q[3], q[0], q[1], q[2]) for q in turned]),
        _scalars([b.shape for b in bodies], "radius"),
        _scalars(states, "mass") / unit**2,
        _vectors(states, "inertia")[:, 0] / unit**2,
        _scalars(materials, "young"),
        _scalars(materials, "poisson"),
        np.array([math.tan(m.frictionAngle) for m in materials]),
    ]


def _contact_arrays(O, law, contacts):
    m = len(contacts)
    phys, geom = [i.phys for i in contacts], [i.geom for i in contacts]
    ids = np.array([(i.id1, i.id2) for i in contacts], dtype=np.int64).reshape(m, 2)
    shift = np.array([list(i.cellDist) for i in contacts], dtype=np.int64).reshape(m, 3)
    names = ("normalAdhesion", "shearAdhesion", "unp", "unpMax")
    cohesive = {name: np.zeros(m) for name in (*names, "fragile", "cohesionBroken")}
    if law != FRICTION:
        cohesive = {name: _scalars(phys, name) for name in cohesive}
    kn, normal = _scalars(phys, "kn"), _vectors(geom, "normal")
    overlap = _scalars(geom, "penetrationDepth")
    elastic = kn * (overlap - cohesive["unp"])
    on_normal = _normal_forces(_vectors(phys, "normalForce"), normal, elastic, -cohesive["normalAdhesion"])
    waits = np.zeros(m, dtype=np.int64)
    if contact_laws.adhesion_of_new_contacts(O):
        _, last_look = contact_laws.looks_for_new_contacts(O)
        waits[:] = (_scalars(contacts, "iterMadeReal") >= last_look) & (cohesive["normalAdhesion"] <= 0)
    return [
        *(ids, shift, waits, kn, _scalars(phys, "ks")),
        *(cohesive[name] for name in names),
        _scalars(phys, "tangensOfFrictionAngle"),
        *(cohesive[name] for name in ("fragile", "cohesionBroken")),
        *(on_normal, _vectors(phys, "shearForce"), normal),
    ]


def _normal_forces(forces, normal, elastic, adhesion):
    """(m,) what times the normal is the force, to the bit: the elastic force, that of the plateau in tension, or none."""
    found = np.einsum("ci,ci->c", forces, normal)
    for guess in (np.zeros(len(forces)), adhesion, elastic):
        found = np.where((guess[:, None] * normal == forces).all(axis=1), guess, found)
    return found


def _scalars(objects, name):
    return np.fromiter(map(attrgetter(name), objects), float, len(objects))


def _vectors(objects, name):
    return np.array([tuple(v) for v in map(attrgetter(name), objects)]).reshape(len(objects), 3)


class Scene:
    """An export as arrays, spheres by id and contacts by ids; names as in bridge/compact_scene.hpp."""

    SPHERES = {"x": 3, "v": 3, "w": 3, "f": 3, "t": 3, "turned": 4}
    SPHERES |= dict.fromkeys("radius mass inertia young poisson tangent".split(), 1)
    CONTACTS = "kn ks normal_adhesion shear_adhesion unp unp_max tangent fragile broken normal_force"
    CONTACTS = {**dict.fromkeys(CONTACTS.split(), 1), "shear": 3, "normal": 3}

    def __init__(self, exported):
        if exported[: len(MAGIC)] != MAGIC:
            raise ValueError("this is not the export of a YADE scene")
        self._words, self._at = np.frombuffer(exported, np.int64, offset=len(MAGIC)), 0
        self.version, self.law, n, m, self.iteration, starts = (int(k) for k in self._take(6))
        self.time_step, self.damping = self._floats(2)
        self.H, self.trsf, self.L, self.previous_L = self._floats(36).reshape(4, 3, 3)
        self.constants = self._floats(9)
        for name, width in self.SPHERES.items():
            setattr(self, name, self._rows(n, width))
        self.ids, self.shift = self._take(2 * m).reshape(m, 2), self._take(3 * m).reshape(m, 3)
        self.waits = self._take(m)
        for name, width in self.CONTACTS.items():
            setattr(self, name, self._rows(m, width))
        self.start = self._floats(6 * n * starts)

    def _take(self, count):
        self._at += count
        return self._words[self._at - count : self._at]

    def _floats(self, count):
        return self._take(count).view(float)

    def _rows(self, count, width):
        numbers = self._floats(count * width)
        return numbers if width == 1 else numbers.reshape(count, width)


def write_back(O, exported):
    """Puts a state of the compact engine into the scene of `O`, which rests and was made from the same template.

    YADE makes the contacts itself: first between spheres large enough for those that are in tension, then, with their
    laws, between the true ones; no time passes. The scene's count of steps becomes that
    of the state. Raises RuntimeError when YADE's contacts are others.
    """
    from yade.utils import Quaternion

    scene = Scene(exported)
    if len(O.bodies) != len(scene.radius):
        raise RuntimeError(f"A state of {len(scene.radius)} spheres does not fit a YADE scene of {len(O.bodies)}.")
    newton, unit, O.dt = O.engines[-1], unit_of_time.of(O).in_a_second, 0.0
    _set_cell(O, scene, np.zeros((3, 3)))
    _place(O, scene, _enlargement(scene))
    O.interactions.clear()
    _again(O)
    contacts = _matched(O, scene)
    for name in ("laws", "forces"):
        _set_contacts(contacts, scene, name)
    _place(O, scene, 1.0)
    _again(O)
    _set_contacts(_matched(O, scene), scene, "forces")
    contact_laws.set_looks(O, scene.iteration)
    O.forces.f(0, True)  # YADE forgets nothing in a reset that it has not summed before
    O.forces.reset(False)
    for b, v, w, f, t, turned in zip(O.bodies, scene.v / unit, scene.w / unit, scene.f, scene.t, scene.turned):
        b.state.vel, b.state.angVel = v, w
        b.state.ori = Quaternion(*turned) * b.state.refOri
        O.forces.addF(b.id, tuple(f))
        O.forces.addT(b.id, tuple(t))
    _set_cell(O, scene, scene.previous_L / unit)
    O.cell.velGrad = _matrix(scene.L / unit)
    newton.damping, O.dt = scene.damping, scene.time_step * unit


def _set_cell(O, scene, L):
    O.cell.hSize, O.cell.trsf = _matrix(scene.H), _matrix(scene.trsf)
    O.cell.velGrad = O.engines[-1].prevVelGrad = _matrix(L)


def _matrix(T):
    from yade.utils import Matrix3

    return Matrix3(*map(float, np.ravel(T)))


def _again(O):
    """From rest to rest without time: positions stay, contacts are found anew."""
    O.step()
    contact_laws.to_forces(O)


def _enlargement(scene):
    """Of the radii, so that all contacts overlap."""
    i, j = scene.ids.T
    d = scene.x[j] + scene.shift @ scene.H.T - scene.x[i]
    return max(1.0, (np.linalg.norm(d, axis=1) / (scene.radius[i] + scene.radius[j])).max(initial=1.0)) * (1 + 1e-6)


def _place(O, scene, factor):
    for b, x, r in zip(O.bodies, scene.x, scene.radius):
        b.state.pos, b.shape.radius = x, float(r) * factor
        b.state.vel = b.state.angVel = (0, 0, 0)


def _matched(O, scene):
    """YADE's contacts in the order of the scene's; those that are too many become potential ones."""
    wanted = {tuple(pair): at for at, pair in enumerate(scene.ids.tolist())}
    found = [None] * len(wanted)
    for i in list(O.interactions):
        at = wanted.get((i.id1, i.id2))
        if at is None:
            O.interactions.erase(i.id1, i.id2)
        else:
            found[at] = i
    for i, pair, shift in zip(found, scene.ids, scene.shift.tolist()):
        if i is None or list(i.cellDist) != shift:
            raise RuntimeError(f"YADE does not find the contact of the bodies {pair[0]} and {pair[1]} of a compact state.")
    return found


def _set_contacts(contacts, scene, what):
    cohesive = scene.law != FRICTION
    for at, i in enumerate(contacts):
        p = i.phys
        if what == "forces":
            i.geom.normal = tuple(scene.normal[at])
            p.normalForce, p.shearForce = tuple(scene.normal_force[at] * scene.normal[at]), tuple(scene.shear[at])
            continue
        i.iterMadeReal = LATER if scene.waits[at] else 0
        p.kn, p.ks, p.tangensOfFrictionAngle = (float(a[at]) for a in (scene.kn, scene.ks, scene.tangent))
        if cohesive:
            p.normalAdhesion, p.shearAdhesion = float(scene.normal_adhesion[at]), float(scene.shear_adhesion[at])
            p.unp, p.unpMax = float(scene.unp[at]), float(scene.unp_max[at])
            p.fragile, p.cohesionBroken = bool(scene.fragile[at]), bool(scene.broken[at])

"""Any YADE scene of grains in a periodic cell becomes a volume element.

What the program needs of a scene is its periodic cell, one collider, one contact loop and one integrator; laws that are
engines of their own stay too. Whatever strains, stops, records or calls back is dropped: the finite elements drive the
cell from then on.
"""

from archive_check import refuse_not_finite
from contact_laws import resting_time_step, to_forces

KEPT = ("ForceResetter", "InsertionSortCollider", "InteractionLoop", "NewtonIntegrator")
DROPPED = (  # with everything derived from them
    "BoundaryController",  # PeriTriaxController, Peri3dController, PeriIsoCompressor, ...
    "PeriodicEngine",  # PyRunner, recorders, snapshots
    "TimeStepper",
    "FieldApplier",  # gravity
)
GRAINS = ("Sphere", "Clump")


def adopt(O):
    """Makes the current scene of `O` a volume element at rest in its reference state.

    Returns {"kept": [...], "dropped": [...], "reset": [...]}, names of engines and sentences. Leaves O.dt at 0.
    Raises ValueError with the reason when the scene cannot serve.
    """
    kept, dropped = _sort_engines(O)
    _refuse_unsuitable(O, [type(e).__name__ for e in kept])
    names = {"kept": [_name(e) for e in kept], "dropped": [_name(e) for e in dropped]}
    O.engines = kept
    return {**names, "reset": _reset(O, kept[-1])}


def drives(O, engine):
    """Whether an engine is of those that adoption drops, but for gravity and its like: it strains, stops or records."""
    bases = [base for base in DROPPED if base != "FieldApplier"]
    return engine.dead or type(engine).__name__ in _with_derived(O, bases)


def finish_step(O):
    """Ends the step in which an error, an exit of a hook or substepping has left the scene; other engines do nothing."""
    O.subStepping = False
    if O.subStep < 0:
        return
    alive = [e for e in O.engines if not e.dead]
    time_step, O.dt = O.dt, 0.0
    for engine in alive:
        engine.dead = True
    O.step()
    for engine in alive:
        engine.dead = False
    O.dt = time_step


def _with_derived(O, bases):
    return {name for base in bases for name in (base, *_derived(O, base))}


def _sort_engines(O):
    droppable = _with_derived(O, DROPPED)
    kept, dropped = [], []
    for engine in O.engines:
        name = type(engine).__name__
        if engine.dead or name in droppable:
            dropped.append(engine)
        elif name in KEPT or name.startswith("Law2_"):
            kept.append(engine)
        else:
            raise ValueError(
                f"The YADE scene has the engine {_name(engine)}, which acts on the grains in a way that a volume "
                "element cannot have: take it out of O.engines at the end of the script."
            )
    return kept, dropped


def _derived(O, base):
    children = set(O.childClassesNonrecursive(base))
    return children.union(*(_derived(O, child) for child in children)) if children else children


def _name(engine):
    return type(engine).__name__ + (f" ({engine.label})" if engine.label else "")


def _refuse_unsuitable(O, names):
    if not O.periodic:
        raise ValueError("The YADE scene has no periodic cell (O.periodic is False): a volume element needs one.")
    for needed in KEPT:
        if names.count(needed) != 1:
            raise ValueError(
                f"The YADE scene has {names.count(needed)} engines {needed}, a volume element needs exactly one; it "
                f"keeps {', '.join(names) or 'no engine'}."
            )
    if names[-1] != "NewtonIntegrator" or names.index("ForceResetter") > names.index("InteractionLoop"):
        raise ValueError(
            f"The YADE scene runs its engines in the order {', '.join(names)}: ForceResetter must come before the "
            "contacts and NewtonIntegrator last."
        )
    for b in O.bodies:
        shape = type(b.shape).__name__
        if shape not in GRAINS:
            raise ValueError(
                f"Body {b.id} of the YADE scene is a {shape}: a volume element is made of grains ({', '.join(GRAINS)}) "
                "in a periodic cell, without walls."
            )
        if not b.dynamic and not b.isClumpMember:
            raise ValueError(f"Body {b.id} of the YADE scene is held (dynamic is False): every grain must be free.")
    massless = [b.id for b in O.bodies if not b.isClumpMember and not 0 < b.state.mass < float("inf")]
    if massless:
        raise ValueError(
            f"Body {massless[0]} of the YADE scene has the mass {O.bodies[massless[0]].state.mass:g} kg: the grains of a volume "
            "element need a positive one; give their material a density."
        )
    _refuse_partly_held(O)
    _refuse_partly_moved(O)
    _refuse_permanent_forces(O)
    if O.interactions.countReal() == 0:
        raise ValueError("The YADE scene has no contacts: a volume element must carry a stress.")


def _refuse_partly_held(O):
    """All grains may be blocked alike (a plane of grains: "zXY"), but not some, and not in all translations."""
    held = {}
    for b in O.bodies:
        if not b.isClumpMember:
            held.setdefault("".join(c for c in "xyz" if c in b.state.blockedDOFs), []).append(b.id)
    if len(held) > 1:
        rare = min(held, key=lambda dofs: len(held[dofs]))
        usual = max(held, key=lambda dofs: len(held[dofs]))
        raise ValueError(
            f"{len(held[rare])} of {sum(map(len, held.values()))} grains of the YADE scene, body {held[rare][0]} among them, "
            f"have their translations blocked by blockedDOFs = \"{rare}\", others by \"{usual}\": a volume element's grains "
            "must all be free, or blocked alike; set blockedDOFs at the end of the script."
        )
    if "xyz" in held:
        raise ValueError(
            'All grains of the YADE scene have their translations blocked (blockedDOFs holds "xyz"): they must be free.'
        )


def _refuse_partly_moved(O):
    """NewtonIntegrator.mask leaves bodies of other groups where they are."""
    mask = next(e for e in O.engines if type(e).__name__ == "NewtonIntegrator").mask
    left = [b.id for b in O.bodies if mask > 0 and not b.mask & mask]
    if left:
        raise ValueError(
            f"The integrator of the YADE scene moves only bodies of its mask {mask}, so not {len(left)} bodies, body {left[0]} "
            "among them: a volume element's grains must all be free; set its mask to 0 at the end of the script."
        )


def _refuse_permanent_forces(O):
    """Forces of O.forces.setPermF are no state of a volume element, and YADE saves them nowhere."""
    if not O.forces.getPermForceUsed():
        return
    pushed = [b.id for b in O.bodies if O.forces.permF(b.id).norm() > 0 or O.forces.permT(b.id).norm() > 0]
    if pushed:
        raise ValueError(
            f"Permanent forces or torques (O.forces.setPermF, setPermT) act on {len(pushed)} bodies of the YADE scene, body "
            f"{pushed[0]} among them: a volume element is loaded by its cell alone, and YADE does not save them; take them "
            "off with O.forces.setPermF(id, Vector3.Zero) and let the scene come to rest before the script ends."
        )


def _reset(O, integrator):
    """Puts the scene at rest in its reference state; sentences on what had to be changed."""
    from yade._utils import calm
    from yade.utils import Matrix3, Vector3

    done = []
    if O.cell.homoDeform != 2:
        done.append("homoDeform of the cell set to 2 (positions and velocities follow the cell)")
        O.cell.homoDeform = 2
    if O.cell.velGrad != Matrix3.Zero or O.cell.nextVelGrad != Matrix3.Zero:
        done.append("velocity gradient of the cell set to zero")
        O.cell.velGrad = Matrix3.Zero
    O.dt = resting_time_step(O)
    to_forces(O)  # these alone: what is not a number must not move the grains, or YADE's collider ends the process
    refuse_not_finite(O, "as its maker left it")
    O.step()  # YADE applies a new velocity gradient in the integrator: one step that takes no time
    O.dt = 0.0
    done.append("velocities of the grains set to zero")
    calm()
    if O.cell.trsf != Matrix3.Identity:
        done.append("deformation gradient of the cell set to the identity")
        O.cell.trsf = Matrix3.Identity
    scaled = [b for b in O.bodies if b.state.densityScaling not in (1.0, -1.0)]  # YADE saves it, but not its use
    if scaled:
        done.append(f"density scaling of {len(scaled)} bodies taken off")
        for b in scaled:
            b.state.densityScaling = 1.0
    if integrator.gravity != Vector3.Zero:
        done.append("gravity set to zero")
        integrator.gravity = Vector3.Zero
    O.stopAtIter, O.stopAtTime = 0, 0.0
    for b in O.bodies:
        b.state.refPos, b.state.refOri = b.state.pos, b.state.ori
    return done

"""Any YADE scene with a periodic cell becomes a volume element.

What the program needs of a scene is its periodic cell, one collider, contact loops and one integrator. Everything that
strains, stops, records or calls back is dropped: the finite elements drive the cell from then on.
"""

COLLIDERS = ("InsertionSortCollider",)
KEPT = ("ForceResetter", "InsertionSortCollider", "InteractionLoop", "NewtonIntegrator")


def adopt(O):
    """Makes the current scene of `O` a volume element at rest in its reference state.

    Returns {"kept": [...], "dropped": [...], "reset": [...]}, engine names and sentences.
    Raises ValueError with the reason when the scene cannot serve.
    """
    from yade.utils import Matrix3

    _refuse_unsuitable(O)
    kept, dropped, reset = [], [], []
    for engine in O.engines:
        (kept if type(engine).__name__ in KEPT and not engine.dead else dropped).append(engine)
    dropped_names = [type(e).__name__ + (f" ({e.label})" if e.label else "") for e in dropped]
    O.engines = kept
    if O.cell.trsf != Matrix3.Identity:
        reset.append("deformation gradient of the cell set to the identity")
        O.cell.trsf = Matrix3.Identity
    if O.cell.velGrad != Matrix3.Zero or O.cell.nextVelGrad != Matrix3.Zero:
        reset.append("velocity gradient of the cell set to zero")
        O.cell.velGrad = Matrix3.Zero
    O.stopAtIter, O.stopAtTime = 0, 0.0
    for b in O.bodies:
        b.state.refPos, b.state.refOri = b.state.pos, b.state.ori
    return {"kept": [type(e).__name__ for e in kept], "dropped": dropped_names, "reset": reset}


def _refuse_unsuitable(O):
    if not O.periodic:
        raise ValueError("The YADE scene has no periodic cell (O.periodic is False): a volume element needs one.")
    names = [type(e).__name__ for e in O.engines if not e.dead]
    for needed in KEPT:
        if names.count(needed) != 1:
            raise ValueError(
                f"The YADE scene has {names.count(needed)} engines {needed}, a volume element needs exactly one; its "
                f"engines are {', '.join(names) or 'none'}."
            )
    if names.index("NewtonIntegrator") < names.index("InteractionLoop"):
        raise ValueError("The YADE scene moves its bodies before it finds their contacts: put NewtonIntegrator last.")
    if len(O.bodies) == 0 or O.interactions.countReal() == 0:
        raise ValueError("The YADE scene has no contacts: a volume element must carry a stress.")

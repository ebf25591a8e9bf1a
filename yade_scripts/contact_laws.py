"""The contact laws of a prepared volume element, by constant stiffnesses kn, kt [N/m] over a polydisperse packing.

delta is the overlap, forces are compression positive; mu is the friction, f_c the adhesion [N].

"adhesive"  f_n = kn delta - f_c while the contact exists, |f_t| <= mu kn delta; sliding leaves the adhesion alone
            (Gilabert, Roux, Castellanos 2007; the law of Nguyen et al. 2017). Two deviations of YADE 2023.02a's
            CohFrict: in tension it holds f_n = -f_c from delta = 0 to delta = -f_c/kn before the contact is lost for
            good; and a contact that slides while its net force is attractive passes no normal force in that step.
"bonded"    f_n = kn delta down to -f_c, |f_t| <= mu (f_n + f_c), until it first slides or opens: then the bond is gone
            and the contact is one of friction.
"friction"  f_n = kn delta, |f_t| <= mu f_n: cheaper, no adhesion.
"paper"     the adhesive law without the deviations: f_n = kn delta - f_c and |f_t| <= mu kn delta while the overlap
            lasts, which ends the contact. YADE has it not: it prepares the packing with "adhesive", which is the same
            between spheres that overlap (unp = f_c/kn) but for contacts that slide under attraction; the packing then
            comes to rest in a compact cell (packing.py), which alone strains it. A dashpot of the normal may be added:
            f_el = max(0, kn delta + c d(delta)/dt) for kn delta, c over the critical one of the pair being
            ve.viscous_damping.

Contacts that form later have no adhesion, in all of them; the adhesive law can give it to them too, see
make_new_contacts_adhesive, the paper's from the first touch on.
"""

import math

LAWS = ("adhesive", "bonded", "friction")  # of YADE
PAPER = "paper"
EVERY = 4  # DEM steps between two looks for new contacts
FINITE_WITHOUT_TIME = {
    "Law2_ScGeom_FrictPhys_CundallStrack",
    "Law2_ScGeom6D_CohFrictPhys_CohesionMoment",
    "Law2_ScGeom_JCFpmPhys_JointedCohesiveFrictionalPM",
}
ADHESION_TAG = "femxdem_adhesion_of_new_contacts"
LOOKS_TAG = "femxdem_looks_for_new_contacts"
STIFFNESS_TAG = "femxdem_constant_stiffness"
SAFETY_TAG = "femxdem_time_step_safety"
PAPER_TAG = "femxdem_paper_law"


def engines(law, kn, kt, damping):
    """YADE's engine list for a periodic cell of spheres: contact detection, `law`, integrator. No law has moments (see
    material), so that the rotations at the contacts, a sixth of a step, need not be followed. Forces are summed in
    whatever order YADE holds the contacts: in the order of the spheres' numbers (loopOnSortedInteractions) a step takes
    three times as long."""
    import yade.wrapper as y

    if law == "friction":
        constant = lambda value: y.MatchMaker(algo="val", val=value)
        loop = y.InteractionLoop(
            [y.Ig2_Sphere_Sphere_ScGeom()],
            [y.Ip2_FrictMat_FrictMat_FrictPhys(kn=constant(kn), ks=constant(kt))],
            [y.Law2_ScGeom_FrictPhys_CundallStrack()],
        )
    else:
        loop = y.InteractionLoop(
            [y.Ig2_Sphere_Sphere_ScGeom6D(updateRotations=False)],
            [y.Ip2_CohFrictMat_CohFrictMat_CohFrictPhys(setCohesionNow=False, setCohesionOnNewContacts=False)],
            [y.Law2_ScGeom6D_CohFrictPhys_CohesionMoment()],
        )
    return [
        y.ForceResetter(),
        y.InsertionSortCollider([y.Bo1_Sphere_Aabb()], verletDist=-0.1),
        loop,
        y.NewtonIntegrator(damping=damping),
    ]


def material(law, kn, kt, radius, density, friction):
    """Material of a sphere of `radius` [m]; the density is the scene's.

    YADE's kn = 2 E1 r1 E2 r2 / (E1 r1 + E2 r2), so E = kn/r keeps kn the same for every pair; its "poisson" is kt/kn.
    """
    import yade.wrapper as y

    values = {"young": kn / radius, "poisson": kt / kn, "frictionAngle": math.atan(friction), "density": density}
    if law == "friction":
        return y.FrictMat(**values)
    return y.CohFrictMat(isCohesive=True, momentRotationLaw=False, normalCohesion=0, shearCohesion=0, **values)


def set_friction(bodies, interactions, friction):
    """Coulomb coefficient of all spheres and of all contacts there are."""
    for b in bodies:
        b.mat.frictionAngle = math.atan(friction)
    for i in interactions:
        i.phys.tangensOfFrictionAngle = friction


def add_adhesion(law, interactions, f_c, friction):
    """Gives every contact without adhesion the force f_c [N]; returns how many there were."""
    count = 0
    for i in interactions:
        p = i.phys
        if p.normalAdhesion > 0:
            continue
        p.unp, p.unpMax = (f_c / p.kn if law == "adhesive" else 0.0), 0.0
        p.normalAdhesion, p.shearAdhesion = f_c, friction * f_c
        p.cohesionBroken, p.fragile = False, law == "bonded"
        count += 1
    return count


def note_constant_stiffness(O, kn, kt):
    """Notes in the scene that every contact, now and later, has kn and kt [N/m]."""
    _note(O, STIFFNESS_TAG, kn, kt)


def constant_stiffness(O):
    """(kn, kt) of the scene's note, or None."""
    return _noted(O, STIFFNESS_TAG)


def make_new_contacts_adhesive(O, f_c, friction):
    """Notes in the scene, with which it is saved, that contacts formed from now on get the adhesion f_c [N]."""
    _note(O, ADHESION_TAG, f_c, friction)
    _note(O, LOOKS_TAG, 0, O.iter)


def adhesion_of_new_contacts(O):
    """(f_c [N], friction) of the scene's note, or None."""
    return _noted(O, ADHESION_TAG)


def note_restored(O):
    """Notes in the scene that it has just been restored, which has added a step to YADE's count."""
    if adhesion_of_new_contacts(O):
        added, last = looks_for_new_contacts(O)
        _note(O, LOOKS_TAG, added + 1, last)


def set_looks(O, steps):
    """Makes the scene's count `steps`, with the last look now: contacts made real from now on wait for the next."""
    _note(O, LOOKS_TAG, O.iter - steps, O.iter)


def steps_made(O):
    """DEM steps of the scene, without those that restoring it has added to YADE's count."""
    return O.iter - looks_for_new_contacts(O)[0]


def looks_for_new_contacts(O):
    """Steps that restoring has added to YADE's count, and that count at the last look for new contacts."""
    noted = _noted(O, LOOKS_TAG)
    return (int(noted[0]), int(noted[1])) if noted else (0, O.iter - 2 * EVERY)


def note_paper_law(O, viscous_damping):
    """Notes in the scene that its contacts have the paper's law, with dashpots of that ratio of the critical damping."""
    _note(O, PAPER_TAG, float(viscous_damping))


def paper_law(O):
    """The ratio of the scene's note, or None: the law is YADE's."""
    noted = _noted(O, PAPER_TAG)
    return noted and noted[0]


def note_time_step_safety(O, safety):
    """Notes in the scene that its time step is `safety` times the critical one of its contact network."""
    _note(O, SAFETY_TAG, safety)


def time_step_safety(O):
    """What the scene's note says, or None."""
    noted = _noted(O, SAFETY_TAG)
    return noted and noted[0]


def _note(O, tag, *numbers):
    O.tags[tag] = " ".join(map(repr, numbers))


def _noted(O, tag):
    return tuple(map(float, O.tags[tag].split())) if tag in O.tags.keys() else None


def run(O, steps, new_adhesion):
    """`steps` DEM steps. Before the cell moves, one that has become long flips, by YADE's own Cell.flipCell (its
    flipFlippable flips after the move, and not in a step that is made part by part). With new_adhesion = (f_c, friction),
    the contacts that have formed since the last look become adhesive at every step number divisible by EVERY: by the
    scene's own count (steps_made), so that no split and no restart moves it."""
    step, flip = O.step, O.cell.flipCell
    if not new_adhesion:
        for _ in range(steps):
            step()
            flip()
        return
    added, last = looks_for_new_contacts(O)
    for _ in range(steps):
        step()
        flip()
        if (O.iter - added) % EVERY == 0:
            add_adhesion("adhesive", [i for i in O.interactions if i.iterMadeReal >= last], *new_adhesion)
            last = O.iter
    _note(O, LOOKS_TAG, added, last)


def to_forces(O):
    """From a step's beginning to the contact forces of that step: cell, contacts, not the integrator (the last)."""
    O.subStepping = True
    for _ in range(len(O.engines)):
        O.step()
    O.subStepping = False


def loop_in_order(O):
    """Forces are summed in the order of the spheres' numbers, as compact cells do it: slower, the same bits."""
    loop = next(e for e in O.engines if type(e).__name__ == "InteractionLoop")
    loop.loopOnSortedInteractions = True


def resting_time_step(O):
    """Time step in which the contact forces of the scene are found again without a slip: none, so that they are the
    same to the bit; a billionth of O.dt for laws that may divide by it (Hertz-Mindlin's does, and answers nan)."""
    loop = next(e for e in O.engines if type(e).__name__ == "InteractionLoop")
    laws = {type(f).__name__ for f in loop.lawDispatcher.functors}
    return 0.0 if laws <= FINITE_WITHOUT_TIME else 1e-9 * O.dt


def sliding_without_normal_force(interactions):
    """The adhesive contacts that pass no normal force in this step (the deviation above). Found again from the same
    place without a slip, they would pass one; see take_normal_force."""
    real = [i for i in interactions if hasattr(i.phys, "normalAdhesion")]
    return [i for i in real if i.phys.normalAdhesion > 0 and i.phys.normalForce.norm() == 0.0]


def take_normal_force(forces, interactions):
    """Takes the normal force of `interactions` back, from the contacts and from YADE's `forces` on the grains."""
    for i in interactions:
        f = i.phys.normalForce
        forces.addF(i.id1, f)
        forces.addF(i.id2, -f)
        i.phys.normalForce = 0 * f

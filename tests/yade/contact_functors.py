"""All contact functors of YADE's package for pairs of spheres, each in a small periodic scene of its own.

What exists is asked from YADE: laws, makers of contact physics (Ip2), makers of geometries (Ig2). A law takes the physics
and geometries that its `bases` name, and what is derived from them: so YADE's dispatchers work. Only materials and options
are given here.
"""

import os
import re
import resource
import signal
import sys
import time
import traceback
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import adoption
import contact_loop
import probing
from cells import FRICTION, element, engine, select, users

LAW_ARGUMENTS = {"Law2_L6Geom_FrictPhys_Linear": "charLen=1e-3", "Law2_ScGeom_BubblePhys_Bubble": "surfaceTension=5e3"}
PHYSICS_ARGUMENTS = {"Ip2_FrictMat_FrictMat_LubricationPhys": "eta=1e-3, eps=0.01"}
COMPARE = 200  # DEM steps beside the scene's own continuation
SECONDS = 6  # of processor time, of one scene; a served one takes 1
SIZE = 20.0  # of the packing of cells.py, so that grains have some 2 cm
COMMON = {"young": 5e7, "poisson": 0.4, "frictionAngle": 0.35, "density": 2600}
BONDED = {"tensileStrength": 1e6, "cohesion": 1e6}
VISCOUS = {"kn": 1e6, "ks": 5e5, "cn": 20.0, "cs": 10.0}
MATERIALS = {  # what each needs beside COMMON, of which it takes what it has
    "BubbleMat": {"surfaceTension": 5e3},
    "CohFrictMat": {"isCohesive": True, "normalCohesion": 1e6, "shearCohesion": 1e6, "fragile": False},
    "CpmMat": {"sigmaT": 1e6, "epsCrackOnset": 1e-2, "relDuctility": 30, "frictionAngle": 0.35},
    "FrictMatCDM": {"young": 5e8, "sigmaMax": 1e8, "alpha": 1.0},
    "FrictViscoMat": {"betan": 0.1},
    "InelastCohFrictMat": {
        **dict.fromkeys(("tensionModulus", "compressionModulus", "shearModulus"), 5e7),
        **dict.fromkeys(("nuBending", "nuTwist", "sigmaTension", "sigmaCompression", "shearCohesion"), 1e6),
        **dict.fromkeys(("creepTension", "creepBending", "creepTwist"), 0.1),
        **dict.fromkeys(("unloadTension", "unloadBending", "unloadTwist"), 1.0),
        **dict.fromkeys(("epsilonMaxTension", "epsilonMaxCompression", "etaMaxBending", "etaMaxTwist"), 1.0),
    },
    "JCFpmMat": BONDED,
    "LudingMat": {"k1": 1e6, "kp": 5e6, "kc": 1e5, "ks": 4e5, "PhiF": 0.1, "G0": 0.0},
    "MortarMat": {**BONDED, "compressiveStrength": 1e7, "ellAspect": 3.0},
    "PartialSatMat": {"young": 5e8},
    "ViscElCapMat": {**VISCOUS, "Capillar": True, "CapillarType": "Willett_numeric", "Vb": 1e-9, "gamma": 0.07, "theta": 10, "dcap": 1e-3},
    "ViscElMat": VISCOUS,
    "WireMat": {"diameter": 2e-3, "strainStressValues": [(0.0019230769, 2.5e6), (0.0192, 3.2195e6), (0.05, 3.8292e6)]},
}
MIXED = {  # of two materials: what makes the pairs of one, and their law
    "Ip2_FrictMat_CpmMat_FrictPhys": (
        ("Ip2_FrictMat_FrictMat_FrictPhys", "Ip2_CpmMat_CpmMat_CpmPhys"), "Law2_ScGeom_CpmPhys_Cpm()"
    ),
    "Ip2_FrictMat_FrictMatCDM_MindlinPhysCDM": (
        ("Ip2_FrictMat_FrictMat_MindlinPhys", "Ip2_FrictMatCDM_FrictMatCDM_MindlinPhysCDM"), "Law2_ScGeom_MindlinPhys_Mindlin()"
    ),
    "Ip2_FrictMat_FrictViscoMat_FrictViscoPhys": (
        ("Ip2_FrictMat_FrictMat_FrictPhys", "Ip2_FrictViscoMat_FrictViscoMat_FrictViscoPhys"), "Law2_ScGeom_FrictPhys_CundallStrack()"
    ),
    "Ip2_FrictMat_PolyhedraMat_FrictPhys": (
        ("Ip2_FrictMat_FrictMat_FrictPhys", "Ip2_PolyhedraMat_PolyhedraMat_PolyhedraPhys"), "Law2_ScGeom_FrictPhys_CundallStrack()"
    ),
}
SCRIPT = """
size, spheres = {packing}
O.periodic = True
O.cell.hSize = Matrix3(size, 0, 0, 0, size, 0, 0, 0, size)
mats = [O.materials.append(m) for m in ({materials})]
for k, (x, r) in enumerate(spheres):
    O.bodies.append(sphere(x, r, material=mats[k * len(mats) // len(spheres)]))
O.engines = [
    ForceResetter(),
    InsertionSortCollider([Bo1_Sphere_Aabb()]),
    InteractionLoop([Ig2_Sphere_Sphere_{geometry}()], [{physics}], [{law}]),
    {engines}
    NewtonIntegrator(damping=.4),
]
O.dt = {step}
O.cell.velGrad = -Matrix3.Identity
O.run(round(1e-3 / O.dt), True)
O.cell.velGrad = Matrix3.Zero
while O.iter < {steps}:
    O.run(100, True)
    if unbalancedForce() < 1e-3:
        break
"""


@dataclass(frozen=True)
class Scene:
    """A contact model: functors with their arguments, and materials given to the spheres in turn."""

    law: str
    physics: tuple  # one or more Ip2
    geometry: str
    materials: tuple  # names
    option: str = ""  # what is special, in words
    law_arguments: str = ""
    physics_arguments: str = ""
    parameters: tuple = ()  # of the materials, over MATERIALS
    engines: str = ""
    more_laws: str = ""
    step: float = 1e-5  # [s]; 0.15 of PWaveTimeStep of COMMON
    steps: int = 5000

    @property
    def name(self):
        physics = " + ".join(dict.fromkeys(self.materials)) + " > " + self.physics[0].rpartition("_")[2]
        return f"{self.law.removeprefix('Law2_')}, {physics}" + (f": {self.option}" if self.option else "")

    @property
    def slug(self):
        """The name of a folder."""
        return re.sub(r"[^A-Za-z0-9]+", "_", self.name)


def derived(base):
    """Names of all classes of YADE derived from `base`."""
    children = set(engine().O.childClassesNonrecursive(base))
    return children.union(*map(derived, children)) if children else children


def _bases(functor):
    import yade.wrapper

    return getattr(yade.wrapper, functor)().bases


def takes(base, made):
    """Whether a functor for `base` is handed what is `made`."""
    return base == made or made in derived(base)


def geometries():
    """{what an Ig2 makes of two spheres}, by its name."""
    return sorted(n.rpartition("_")[2] for n in derived("IGeomFunctor") if n.startswith("Ig2_Sphere_Sphere_"))


def physics():
    """{Ip2: what it makes}, by their names."""
    return {name: name.rpartition("_")[2] for name in sorted(derived("IPhysFunctor"))}


def laws():
    """{law: (geometry of spheres that suits best or None, what physics it is for)}."""
    found = {}
    for law in sorted(derived("LawFunctor")):
        geometry, own = _bases(law)
        fitting = [g for g in geometries() if takes(geometry, g)]
        best = geometry if geometry in fitting else next((g for g in fitting if g == "ScGeom"), None)
        found[law] = (best, own)
    return found


def own_scenes():
    """A Scene for each law for spheres with the physics that it is for; {law: reason} of the others."""
    scenes, without = [], {}
    for law, (geometry, own) in laws().items():
        makers = [ip2 for ip2, made in physics().items() if made == own]
        if geometry is None:
            without[law] = f"takes {_bases(law)[0]}, which no Ig2 makes of two spheres"
        elif not makers:
            without[law] = f"takes {own}, which no Ip2 makes"
        for ip2 in makers if geometry else ():
            scenes.append(_scene(law, ip2, geometry))
    return scenes, without


def derived_scenes():
    """Scenes of laws with a physics that is derived from their own: what YADE's dispatcher hands them as well."""
    return [
        _scene(law, ip2, geometry)
        for law, (geometry, own) in laws().items()
        for ip2, made in physics().items()
        if geometry and made != own and takes(own, made)
    ]


def _scene(law, ip2, geometry):
    one, other = _bases(ip2)
    own, more = MIXED.get(ip2, ((), ""))
    materials = (one,) if one == other else (one, other)
    return Scene(law, (ip2, *own), geometry, materials, law_arguments=LAW_ARGUMENTS.get(law, ""), more_laws=more,
                 physics_arguments=PHYSICS_ARGUMENTS.get(ip2, ""))


def material(name, parameters=()):
    """The expression that makes a material of class `name`."""
    import yade.wrapper

    has = getattr(yade.wrapper, name)().dict()
    values = {k: v for k, v in COMMON.items() if k in has} | MATERIALS.get(name, {}) | dict(parameters)
    return f"{name}({', '.join(f'{k}={v!r}' for k, v in values.items())})"


def packing():
    """(size of the cube, [(position, radius)]) of the spheres of cells.FRICTION, SIZE times as large, as text."""
    O = select(element(FRICTION))
    spheres = [(tuple(SIZE * x for x in O.cell.wrap(b.state.pos)), SIZE * b.shape.radius) for b in O.bodies]
    return repr((SIZE * O.cell.hSize[0, 0], spheres))


def script(scene, packing_text):
    """The user's script of a Scene."""
    makers = ", ".join(f"{p}({scene.physics_arguments if k == 0 else ''})" for k, p in enumerate(scene.physics))
    law = f"{scene.law}({scene.law_arguments})" + (", " + scene.more_laws if scene.more_laws else "")
    materials = ", ".join(material(m, scene.parameters) for m in scene.materials) + ","
    return SCRIPT.format(packing=packing_text, materials=materials, geometry=scene.geometry, physics=makers, law=law,
                         engines=scene.engines + "," if scene.engines else "", step=scene.step, steps=scene.steps)


def outcome(scene, packing_text, folder):
    """What becomes of a Scene, in a process of its own: {"what": "kn, ks" | "probing" | "refused" | "died", "why":
    reason, and of served ones "difference": of the scene's own continuation, "notes", "eq2": error of Eq. (2) against
    probes, "step": error of the stress after 1 % of strain against that in a tenth of the time step}."""
    reader, writer = os.pipe()
    sys.stdout.flush()
    child = os.fork()
    if child == 0:
        os.close(reader)
        try:
            os.chdir(folder)
            _quiet()
            resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
            said = _made(scene, packing_text, Path(folder), lambda: os.write(writer, b"ran\n"))
            os.write(writer, repr(said).encode())
        except Exception as error:
            said = {"what": "died", "why": "".join(traceback.format_exception_only(error)).strip()}
            os.write(writer, repr(said).encode())
        finally:
            os._exit(0)
    os.close(writer)
    with os.fdopen(reader) as pipe:
        *stage, said = pipe.read().split("\n")
    _, status = os.waitpid(child, 0)
    if said:
        return eval(said, {"nan": float("nan"), "inf": float("inf")})
    why = signal.Signals(os.WTERMSIG(status)).name if os.WIFSIGNALED(status) else f"status {os.WEXITSTATUS(status)}"
    if why == "SIGKILL":
        why = f"no end in {SECONDS} s"
    if not stage:
        return {"what": "refused", "why": f"the script's own simulation does not end well in YADE: {why}"}
    return {"what": "died", "why": why}


def _quiet():
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for descriptor in (1, 2):
        os.dup2(nowhere, descriptor)


def _made(scene, packing_text, folder, ran):
    """ran() is called when the script has ended."""
    path = folder / "theirs.py"
    path.write_text(script(scene, packing_text))
    finish_step, adoption.finish_step = adoption.finish_step, lambda O: (ran(), finish_step(O))
    try:
        made = engine().make_template(users("script", path, script_steps=30_000, compare=COMPARE))
    except (ValueError, RuntimeError) as error:
        return {"what": "refused", "why": str(error)}
    m = made["manifest"]
    if not m["mean_stress"] > 0:  # bridge/straining.cpp
        return {"what": "refused", "why": f"mean stress {m['mean_stress']:.3g} Pa: without pressure the inertial number sets no rate"}
    ve = engine().add(made["state"])
    O = select(ve)
    c = contact_loop.contacts(O)
    said = {"what": "kn, ks" if contact_loop.has_stiffness(O, c) else "probing", "why": "", "notes": m["notes"],
            "difference": m["continuation"]["difference"]["at rest"], "unbalanced": m["unbalanced_force"],
            "step_from": m["time_step_from"]}
    if said["what"] == "kn, ks":
        kn, kt = contact_loop.stiffnesses(O, c)
        eq2 = contact_loop.stiffness(c, kn, kt, O.cell.volume)
        probed = probing.stiffness(O, engine()._love_weber)
        said["eq2"] = float(np.linalg.norm(eq2 - probed) / np.linalg.norm(probed))
    said["step"], said["step_unbalanced"] = _error_of_step(made["state"])
    return said


def _error_of_step(state, strain=1e-2, inertial_number=5e-3):
    stresses, unbalanced = [], []
    for fraction in (1, 0.1):
        ve = engine().add(state)
        engine().O.dt *= fraction
        L = inertial_number / engine().info(ve)["time_scale"] * np.diag([0.2, -1.0, 0.2])
        engine().deform(ve, L, max(1, round(strain / (np.linalg.norm(L) * engine().O.dt))))
        stresses.append(np.array(engine()._utils.getStress()).ravel())
        unbalanced.append(engine()._utils.unbalancedForce())
        engine().remove(ve)
    return float(np.linalg.norm(stresses[0] - stresses[1]) / np.linalg.norm(stresses[1])), unbalanced[0]


def _scene_with(law, option, **changes):
    """The own Scene of a law with something special."""
    found = next(s for s in own_scenes()[0] if s.law == law and len(s.materials) == 1)
    return replace(found, option=option, **changes)


def options():
    """Scenes of what the functors and materials can do besides: dashpots, moments, adhesion, creep, capillary bridges."""
    mindlin, cohesive = "Law2_ScGeom_MindlinPhys_Mindlin", "Law2_ScGeom6D_CohFrictPhys_CohesionMoment"
    viscous, lubricated = "Law2_ScGeom_ViscElPhys_Basic", "Law2_ScGeom_ImplicitLubricationPhys"
    moments = (("momentRotationLaw", True), ("alphaKr", 1.0), ("alphaKtw", 1.0), ("etaRoll", 0.1), ("etaTwist", 0.1))
    always = "always_use_moment_law=True, useIncrementalForm=True"
    capillary = "Law2_ScGeom_CapillaryPhys_Capillarity(capillaryPressure=1e4)"
    kinds = ("Willett_numeric", "Willett_analytic", "Weigert", "Rabinovich", "Lambert", "Soulie")
    return [
        _scene_with(mindlin, "dashpots betan, betas", physics_arguments="betan=0.2, betas=0.1"),
        _scene_with(mindlin, "dashpots en, es", physics_arguments="en=0.5, es=0.5"),
        _scene_with(mindlin, "rolling and twisting", law_arguments="includeMoment=True", physics_arguments="krot=1e2, ktwist=1e2, eta=0.1"),
        _scene_with(mindlin, "adhesion", law_arguments="includeAdhesion=True", physics_arguments="gamma=1.0"),
        _scene_with(cohesive, "rolling, frictional", law_arguments=always, parameters=(*moments, ("isCohesive", False))),
        _scene_with(cohesive, "rolling, cohesive, set on new contacts", law_arguments=always, parameters=moments,
                    physics_arguments="setCohesionOnNewContacts=True"),
        _scene_with(cohesive, "moments in total form", parameters=moments, physics_arguments="setCohesionNow=True"),
        _scene_with(cohesive, "creep", law_arguments="shear_creep=True, creep_viscosity=1e6", physics_arguments="setCohesionOnNewContacts=True"),
        _scene_with("Law2_ScGeom_ViscoFrictPhys_CundallStrack", "creep", law_arguments="shearCreep=True, viscosity=1e6"),
        _scene_with("Law2_ScGeom_FrictPhys_CundallStrack", "never erased", law_arguments="neverErase=True"),
        _scene_with(viscous, "contact time and restitution", physics_arguments="tc=MatchMaker(algo='val', val=1e-3), "
                    "en=MatchMaker(algo='val', val=.5), et=MatchMaker(algo='val', val=.5)"),
        _scene_with(viscous, "rolling mR", parameters=(("mR", 0.1), ("mRtype", 2))),
        _scene_with(viscous, "lubrication", parameters=(("lubrication", True),)),
        *(_scene_with("Law2_ScGeom_ViscElCapPhys_Basic", f"bridges of {kind}", parameters=(("CapillarType", kind),)) for kind in kinds),
        _scene_with("Law2_ScGeom_ViscElCapPhys_Basic", "no bridges", parameters=(("Capillar", False),)),
        _scene_with(lubricated, "viscosity", physics_arguments="eta=1e-2, eps=0.01"),
        _scene_with("Law2_ScGeom_VirtualLubricationPhys", "viscosity", physics_arguments="eta=1e-2, eps=0.01"),
        _scene_with("Law2_ScGeom_JCFpmPhys_JointedCohesiveFrictionalPM", "bonded", physics_arguments="cohesiveTresholdIteration=100"),
        _scene_with("Law2_ScGeom_CpmPhys_Cpm", "bonded", physics_arguments="cohesiveThresholdIter=100"),
        _scene_with("Law2_ScGeom_MortarPhys_Lourenco", "bonded", physics_arguments="cohesiveThresholdIter=100"),
        _scene_with("Law2_ScGeom_WirePhys_WirePM", "linked", physics_arguments="linkThresholdIteration=1000"),
        replace(_scene_with("Law2_ScGeom_FrictPhys_CundallStrack", "capillary bridges by an engine"),
                physics=("Ip2_FrictMat_FrictMat_CapillaryPhys",), engines=capillary),
        replace(_scene_with(mindlin, "capillary bridges by an engine"),
                physics=("Ip2_FrictMat_FrictMat_MindlinCapillaryPhys",), engines=capillary),
    ]


SILENT = 1e-6  # difference from the scene's own continuation that must be said
MEASURES = ("stress", "normal forces", "shear forces")


def difference(found):
    """The largest of a served scene's differences from its own continuation, at rest."""
    return max(found["difference"][name] for name in MEASURES)


def faults(found):
    """Sentences on what must not be: nothing where the scene is served and right, or refused."""
    if found["what"] == "died":
        return [f"{found['what']} {found['why']}"]
    if found["what"] == "refused":
        return []
    said = []
    if not difference(found) <= SILENT and not any("differs from the scene going on" in note for note in found["notes"]):
        said.append(f"differs by {difference(found):.1e} without a word")
    if not found["step"] <= 0.05 and found["step_unbalanced"] < 0.2:
        said.append(f"its time step errs by {found['step']:.1e} without a word")
    return said


def row(scene, found):
    """A row of the table: law, physics, what becomes of it, differences, words."""
    law, _, rest = scene.name.partition(", ")
    if found["what"] not in ("kn, ks", "probing"):
        return f"| `{law}` | {rest} | {found['what']} | | | | {_short(found['why'])} |"
    difference_from_itself = f"{difference(found):.0e}, {found['difference']['contacts']}"
    stiffness = f"{found['eq2']:.1%}" if "eq2" in found else ""
    said = "; ".join([f"step from {found['step_from']}", *faults(found)])
    return f"| `{law}` | {rest} | served, {found['what']} | {difference_from_itself} | {stiffness} | {found['step']:.0e} | {said} |"


def _short(why):
    """The reason without what the row says already, its folder and the advice."""
    why = re.sub(r" \((contact )?law [^)]*\)", "", why.split(";")[0].split(" (relative")[0])
    return re.sub(r've.script = "[^"]*"', "the script", why)


def table(outcomes):
    """Markdown of [(Scene, outcome)]."""
    head = ["| law | physics | | difference from its own continuation: forces, contacts | Eq. (2) against probes | 1 % of strain against a "
            "tenth of the step | |", "|---|---|---|---|---|---|---|"]
    return [*head, *(row(scene, found) for scene, found in outcomes)]


if __name__ == "__main__":
    import tempfile
    text = packing()
    scenes, without = own_scenes()
    scenes += options()
    if "--derived" in sys.argv:
        scenes = derived_scenes()
    wanted = [s for s in scenes if any(w in s.name for w in sys.argv[1:])] or scenes
    for s in wanted:
        t = time.time()
        with tempfile.TemporaryDirectory() as f:
            found = outcome(s, text, f)
            print(row(s, found), f"{time.time() - t:.1f} s", found.get("notes"), faults(found), flush=True)

# A YADE script as people write them: 200 frictional spheres in a periodic cell, loaded to 100 kPa; with the argument "rolling"
# their contacts resist rolling and twisting.
import sys

from yade import pack

O.periodic = True
O.cell.hSize = Matrix3(.1, 0, 0, 0, .1, 0, 0, 0, .1)
grains = dict(young=5e7, poisson=.4, frictionAngle=radians(5), density=2600)
if "rolling" in sys.argv:
    O.materials.append(CohFrictMat(isCohesive=False, momentRotationLaw=True, alphaKr=1, alphaKtw=1, etaRoll=.2, etaTwist=.2, **grains))
    loop = InteractionLoop([Ig2_Sphere_Sphere_ScGeom6D()], [Ip2_CohFrictMat_CohFrictMat_CohFrictPhys()],
                           [Law2_ScGeom6D_CohFrictPhys_CohesionMoment(always_use_moment_law=True, useIncrementalForm=True)])
else:
    O.materials.append(FrictMat(**grains))
    loop = InteractionLoop([Ig2_Sphere_Sphere_ScGeom()], [Ip2_FrictMat_FrictMat_FrictPhys()], [Law2_ScGeom_FrictPhys_CundallStrack()])
cloud = pack.SpherePack()
cloud.makeCloud((0, 0, 0), (.1, .1, .1), rMean=.007, rRelFuzz=.2, num=200, periodic=True, seed=4)
cloud.toSimulation()
O.engines = [
    ForceResetter(),
    InsertionSortCollider([Bo1_Sphere_Aabb()]),
    loop,
    PeriTriaxController(goal=(-1e5, -1e5, -1e5), stressMask=7, dynCell=True, maxStrainRate=(1, 1, 1), maxUnbalanced=.005,
                        relStressTol=.005, globUpdate=5, doneHook="finished()"),
    NewtonIntegrator(damping=.3),
]
O.dt = .5 * PWaveTimeStep()


def finished():
    setContactFriction(radians(25))
    O.pause()


O.run(60000, True)

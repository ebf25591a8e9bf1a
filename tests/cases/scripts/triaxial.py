# small periodic triaxial, 80 spheres; the places in braces differ from test to test
from yade import pack
O.periodic = True
O.cell.hSize = Matrix3(.1, 0, 0, 0, .1, 0, 0, 0, .1)
mat = O.materials.append({material})
cloud = pack.SpherePack()
cloud.makeCloud((0, 0, 0), (.1, .1, .1), rMean=.0095, rRelFuzz=.2, num=80, periodic=True, seed=4)
ids = cloud.toSimulation(material=mat)
{bodies}
O.engines = [
    ForceResetter(),
    InsertionSortCollider([Bo1_Sphere_Aabb()]),
    InteractionLoop([{geometry}()], [{physics}], [{law}]),
    PeriTriaxController(label='triax', goal=(-1e5, -1e5, -1e5), stressMask=7, dynCell=True, maxStrainRate=(1, 1, 1),
                        maxUnbalanced=.01, relStressTol=.01, globUpdate=5, doneHook='ready()'),
    NewtonIntegrator(damping=0.3, label='newton'),
]
O.dt = {step}
def ready():
    {ready}
{run}
{end}

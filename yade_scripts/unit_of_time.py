"""The unit of time of a prepared packing's scene.

YADE's integrator counts the squared velocity of the cell's boundary as if it were the fastest sphere's share of the
collider's margin: where it comes to 1 in the scene's units, 1 m/s in SI, the collider runs in every step and takes
almost half of it. That is at an inertial number of 2e-2 from 100 kPa on. So prepared scenes count time in a shorter
unit: masses and densities are larger by the square of the units in a second, velocities smaller by their number;
lengths, forces, stress, stiffness are what they are. The number is a power of two, so that no digit changes. Whoever
takes a time, a rate or a density out of a scene, or puts one in, converts it here; scenes and scripts of users keep
their seconds.
"""

import math
from dataclasses import dataclass

TAG = "femxdem_units_of_time_in_a_second"
# The boundary's velocity over sqrt(p/rho) n^(1/3) at I = 1: sqrt(3) of a cube, at up to twice the rate, stretched fourfold
BOUNDARY = 16.0


@dataclass(frozen=True)
class UnitOfTime:
    in_a_second: float = 1.0

    def seconds(self, time):
        """[s] of the scene's time."""
        return time / self.in_a_second

    def scene_rate(self, rate):
        """The scene's rate, velocity or velocity gradient of one in [1/s]."""
        return rate / self.in_a_second

    def scene_density(self, density):
        """The scene's density, mass or moment of inertia of one in SI."""
        return density * self.in_a_second**2

    def density(self, scene_density):
        """[kg/m^3] of the scene's density."""
        return scene_density / self.in_a_second**2


SECOND = UnitOfTime()


def suited(pressure, density, spheres):
    """A unit in which the boundary of a cell of so many spheres of `density` [kg/m^3], adopted under `pressure` [Pa],
    stays below 1 at any inertial number up to 1."""
    velocity = BOUNDARY * math.sqrt(pressure / density) * spheres ** (1 / 3)
    return UnitOfTime(2.0 ** math.ceil(math.log2(velocity)))


def note(O, unit):
    """Notes the unit in the scene, with which it is saved."""
    O.tags[TAG] = repr(unit.in_a_second)


def of(O):
    """The unit of YADE's current scene; the second where nothing is noted."""
    return UnitOfTime(float(O.tags[TAG])) if TAG in O.tags.keys() else SECOND

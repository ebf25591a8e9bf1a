"""The paths on which one element and YADE alone are compared."""

import math
from dataclasses import dataclass

CONFINING_STRESS = 1e5  # sigma_0 [Pa]
INCREMENT = 1e-3  # of the element's driven strain


@dataclass
class Path:
    """The driven component goes from target to target: strain_yy (logarithmic), in simple shear gamma = F_12."""

    name: str
    targets: tuple
    held: tuple = ()  #: axes whose stress is kept at -sigma_0
    strains: tuple = (0.0, 1.0, 0.0)  #: strain of each axis over the driven one, where no stress is held

    def rate(self):
        """Norm of the strain rate over the rate of the driven component; held axes: as if the volume were kept."""
        if self.name == "simple_shear":
            return math.sqrt(0.5)
        lateral = -sum(self.strains[axis] for axis in range(3) if axis not in self.held) / max(1, len(self.held))
        return math.hypot(*[lateral if axis in self.held else self.strains[axis] for axis in range(3)])

    def segments(self):
        """[[path]] tables of a case."""
        text, before = "", 0.0
        for target in self.targets:
            text += f"[[path]]\nincrements = {max(1, round(abs(target - before) / INCREMENT))}\n"
            if self.name == "simple_shear":
                text += f"deformation_gradient = [1.0, {target!r}, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]\n"
            else:
                for axis, name in enumerate(("xx", "yy", "zz")):
                    if axis in self.held:
                        text += f"stress_{name} = {-CONFINING_STRESS!r}\n"
                    else:
                        text += f"strain_{name} = {target * self.strains[axis]!r}\n"
            before = target
        return text


PATHS = {
    path.name: path
    for path in (
        Path("triaxial_compression", (-0.05,), held=(0, 2)),
        Path("triaxial_extension", (0.03,), held=(0, 2)),
        Path("biaxial", (-0.05,), held=(0,)),
        Path("biaxial_to_10", (math.log(0.9),), held=(0,)),
        Path("isotropic", (-0.01,), strains=(1.0, 1.0, 1.0)),
        Path("oedometric", (-0.03,)),
        Path("simple_shear", (0.1,)),
        Path("biaxial_cycle", (-0.02, -0.012, -0.03), held=(0,)),
    )
}

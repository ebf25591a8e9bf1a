"""The mean stress of a trial."""


class MeanStress:
    """Weighted mean over `steps` DEM steps of stresses (9,), by the trapezoidal rule; weight 1 + late (2 t / T - 1). The same
    operations in the same order as Mean of bridge/compact_cell.cpp."""

    def __init__(self, steps, late):
        self._steps, self._late = float(steps), late
        self._sum, self._last, self._last_step = 0.0, None, 0

    def add(self, step, stress):
        weighted = (1 + self._late * (2 * float(step) / self._steps - 1)) * stress
        if self._last is not None:
            self._sum = self._sum + 0.5 * float(step - self._last_step) * (self._last + weighted)
        self._last, self._last_step = weighted, step

    def mean(self):
        return self._sum / self._steps


def sampled_steps(steps, every):
    """Numbers of the steps after which a stress is taken: multiples of `every`, and the last."""
    return [*range(every, steps, every), steps]

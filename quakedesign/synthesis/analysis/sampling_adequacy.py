"""Whether a fault is sampled fast enough for how fast it runs away."""

import cmath
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from quakedesign.certificates.guarantee import task_of
from quakedesign.errors import ParameterError
from quakedesign.fault import Fault
from quakedesign.symbolic import derive
from quakedesign.synthesis.linear.plant.sliding_model import sliding_model, sliding_poles

LARGEST_PRODUCT = 0.2
"""Of T_s and the unstable pole: five samples while an error grows e-fold, so that what one sample has not seen grows by
at most 22 % until the next one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SamplingAdequacy:
    """Sampling time of a fault beside its instability.

    Attributes
    ----------
    step : float
        T_s [s].
    pole : float
        Modulus of the fastest pole that grows [1/s]; 0 where none does.
    over_box : bool
        Whether `pole` is the fastest over the uncertainty box, at any pressure that equilibrium along the reference may
        need there; if not, that of the nominal fault at its operating point: at rest, or with one state in slow sliding
        along its task, whose mean rate sets it.
    """

    step: float
    pole: float
    over_box: bool

    @property
    def pole_times_step(self) -> float:
        """T_s times the pole [-]: logarithm of the growth of an error between two samples."""
        return self.pole * self.step

    @property
    def adequate(self) -> bool:
        """Whether that is at most 1/5."""
        return self.pole_times_step <= LARGEST_PRODUCT

    @property
    def adequate_step(self) -> float | None:
        """Largest adequate T_s [s]; None where any is."""
        return LARGEST_PRODUCT / self.pole if self.pole else None

    def to_dict(self) -> dict[str, Any]:
        """Keys of DESIGN.md, with the pole [1/s], the limit [-] and the largest adequate step [s]."""
        return {
            "step": self.step,
            "pole": self.pole,
            "over_box": self.over_box,
            "pole_times_step": self.pole_times_step,
            "limit": LARGEST_PRODUCT,
            "adequate": self.adequate,
            "adequate_step": self.adequate_step,
        }


@lru_cache(maxsize=64)
def sampling_adequacy(fault: Fault) -> SamplingAdequacy:
    """Compare a fault's sampling time with its fastest unstable pole.

    The rule is one of thumb, necessary in spirit: a sampled law answers what happens between two samples only after it
    has grown by e^{pT_s}. It is no proof; what a given law bears is certified by its largest step.

    Parameters
    ----------
    fault : Fault
    """
    try:
        poles, over_box = _box_poles(fault), True
    except ParameterError:
        poles, over_box = _nominal_poles(fault), False
    pole = max((abs(z) for z in poles if z.real > 0), default=0.0)
    return SamplingAdequacy(step=fault.sampling_time, pole=pole, over_box=over_box)


def _nominal_poles(fault: Fault) -> list[complex]:
    if len(fault.friction.state_names) == 1:
        return list(sliding_poles(sliding_model(fault)))
    return [complex(z) for z in derive(fault).eigenvalues]


def _box_poles(fault: Fault) -> list[complex]:
    """Poles [1/s] of λ² + wλ − s at the corners: real ones grow with s and fall with w, of others |λ|² = −s.

    Raises
    ------
    ParameterError
        When no finite range of s is found, or friction has a state.
    """
    fault.require_memoryless("the range of unstable poles")
    task = task_of(fault)
    poles = []
    for slope in map(float, task.slip_chord):
        for damping in map(float, task.rate_chord):
            root = cmath.sqrt(damping**2 + 4 * slope)
            poles += [(-damping + root) / 2, (-damping - root) / 2]
    return poles

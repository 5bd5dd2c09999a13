"""Laws for a fault behind a lag or a layer of rock: gains of a discrete Riccati equation on fault and path."""

from dataclasses import dataclass
from fractions import Fraction
from math import exp

import numpy as np
from scipy.linalg import expm, solve_discrete_are

from quakedesign.certificates.guarantee.held import Around
from quakedesign.loop import Layer, Model, PathModel
from quakedesign.loop.laws import Row
from quakedesign.loop.layer import MODES
from quakedesign.synthesis.guaranteed.rounding import rounded, short

THROUGH_ROCK = ((-2.4, -9.3, 0.12), (-2.0, -8.0, 0.06), (-3.0, -9.5, 0.25))  # where good laws were seen
BEHIND_LAG = ((-2.4, -6.0, 0.3), (-1.0, -4.0, 0.5))
_MOST_STATES = 20  # of a loop
_WITHOUT_PATH = 6  # e1, e2, π2, d, the valve, its last step or the well, of a law that does not know the lag


def path_modes(step: Fraction, around: Around, *, observed: bool = False) -> int:
    """How many modes of a layer a law may know so that the loop keeps within the states of a file; 0 without one.

    Below 0 there are too many states even so. A law of the slip alone has one state more.
    """
    ages = -int(-around.get("delay", Fraction(0)) // step)
    layer, behind = MODES if around.get("diffusion") else 0, bool(around.get("lag"))
    free = _MOST_STATES - _WITHOUT_PATH - layer - behind - 2 * ages - observed
    return free if layer else min(free, 0)


@dataclass(frozen=True, slots=True)
class PathFeedback:
    """A model of fault and path, and the feedback of both by a linear quadratic regulator on the sampled pair."""

    model: PathModel
    gain: Fraction
    flow: np.ndarray
    first: np.ndarray
    unit: float
    push: float

    @classmethod
    def of(cls, model: Model, step: Fraction, around: Around, *, observed: bool = False) -> "PathFeedback":
        """With as many modes of a layer as a law may know, of the slip alone if `observed`."""
        gain = float(model.gain)
        flow, first = _sampled(model, step, around, path_modes(step, around, observed=observed))
        path = PathModel(
            of_errors=rounded(flow[:2, :2]),
            of_pressures=rounded(flow[:2, 2:] / gain),
            of_asked=rounded([first[:2] / gain])[0],
            kept=rounded(flow[2:, 2:]),
        )
        unit = float(around.get("diffusion") or step + around.get("delay", 0) + around["lag"])
        return cls(path, short(gain), flow, first, unit, unit * gain)

    def gains(self, slip: float, pressure: float) -> Row:
        """For logarithms of the weights of slip error and pressure, that of the slip-rate error being 1.

        Time is in L²/D or, without a layer, in what passes before a pressure acts.

        Raises
        ------
        LinAlgError
            Where the Riccati equation has no solution.
        """
        weights = np.zeros(self.flow.shape)
        weights[0, 0], weights[1, 1] = exp(slip) / self.unit**2, 1
        cost = exp(pressure) * self.push**2
        riccati = solve_discrete_are(self.flow, self.first[:, None], weights, np.array([[cost]]))
        found = self.first @ riccati @ self.flow / (cost + self.first @ riccati @ self.first)
        return tuple(short(float(v)) for v in found)


def _sampled(model: Model, step: Fraction, around: Around, modes: int) -> tuple[np.ndarray, np.ndarray]:
    """Over one period: what becomes of e1, e2, the path's pressures and those asked for before, and of p [Pa]."""
    delay, lag = around.get("delay", Fraction(0)), around.get("lag", Fraction(0))
    whole, late = int(delay // step), float(delay % step)
    ages = whole + (late > 0)
    lagging, layer = int(lag > 0), Layer(time=around.get("diffusion") or lag)
    size = 2 + lagging + modes
    shares = np.array([float(layer.share(i)) for i in range(modes)])
    rates = np.array([float(layer.rate(i)) for i in range(modes)])
    flow = np.zeros((size + 1, size + 1))  # the last one is the valve's pressure
    well = 2 if lagging else size
    flow[0, 1] = 1
    flow[1, :2] = float(model.slip), -float(model.rate)
    flow[1, size - modes : size] = float(model.gain) * shares
    flow[1, well] += float(model.gain) * (1 - shares.sum())
    if lagging:
        flow[2, [2, size]] = -1 / float(lag), 1 / float(lag)
    for i, rate in enumerate(rates):
        mode = size - modes + i
        flow[mode, mode], flow[mode, well] = -rate, rate
    whole_size = size + ages + 1  # with p last
    period = np.eye(whole_size)
    for valve, duration in ((size + ages - 1, late), (size + whole - 1 if whole else size + ages, float(step) - late)):
        part = expm(flow * duration)
        turn = np.eye(whole_size)
        turn[:size, :size], turn[:size, valve] = part[:size, :size], part[:size, size]
        period = turn @ period if duration else period
    if ages:
        period[size:-1] = 0
        period[size, -1] = 1
        period[range(size + 1, size + ages), range(size, size + ages - 1)] = 1
    return period[:-1, :-1], period[:-1, -1]

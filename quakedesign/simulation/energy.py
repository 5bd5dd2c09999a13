"""Where the energy of a run went: forces times rates on one side, stored energies on the other."""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import casadi as ca

from quakedesign.loop.schemes import Stepped
from quakedesign.simulation.loading import Load
from quakedesign.symbolic import plant

WORKS = ("work_weakening", "work_injection", "work_viscous", "work_disturbance", "sum_slip")


@dataclass(frozen=True, slots=True, kw_only=True)
class EnergyBudget:
    """Energies between the start and the end of a run [J]; what was stored or dissipated came from some work.

    kinetic + elastic + frictional + viscous − far_field − disturbance − residual = 0.

    Attributes
    ----------
    kinetic, elastic : float
        Change of ½m·x2² and of ½k·stretch² [J].
    frictional : float
        Heat of friction under the pressure that acted, ∫μA(σ' − p)·x2 dt [J].
    injection : float
        Share of the frictional work that the pressure relieved, ∫μAp·x2 dt [J]: without it friction would have taken
        frictional + injection on the same way.
    viscous : float
        Heat of the dashpot (radiation damping, where that is the damping), ∫η(x2 − v_∞)² dt [J].
    far_field : float
        Work of the drifting far end on spring and dashpot [J]; 0 without drift.
    disturbance : float
        Work of φ_e, ∫mφ̂_e·x2 dt [J].
    """

    kinetic: float
    elastic: float
    frictional: float
    injection: float
    viscous: float
    far_field: float
    disturbance: float

    @property
    def residual(self) -> float:
        """What is missing [J]: the error of the integration, since works are integrated along with the motion."""
        return self.kinetic + self.elastic + self.frictional + self.viscous - self.far_field - self.disturbance

    @property
    def relative_residual(self) -> float:
        """|Residual| over the largest other entry [-]; 0 where nothing happened."""
        entries = self.to_dict()
        return abs(entries.pop("residual")) / largest if (largest := max(map(abs, entries.values()))) else 0.0

    def to_dict(self) -> dict[str, float]:
        """Return the energies [J] by name."""
        return asdict(self) | {"residual": self.residual}

    @staticmethod
    def unit(name: str) -> str:
        """SI unit of one entry."""
        return "" if name == "relative_residual" else "J"


class Meter:
    """A loop in its own place while steps of it are written down, which adds up the works of its forces.

    Attributes
    ----------
    loop : ClosedLoop
    works : SX
        So far, in the order of `WORKS`.
    """

    def __init__(self, loop: Any, works: Any) -> None:
        self.loop, self.works = loop, works

    def __getattr__(self, name: str) -> Any:
        return getattr(self.loop, name)

    def advance(self, method: Any, motion: Any, state: Any, step: float) -> Any:
        """See `Stepped.advance`; the works are integrated along with the motion."""
        size = state.shape[0]

        def with_powers(plant: Any, passed: Any, now: Any) -> Any:
            seen: list[Any] = []

            def watched(time: Any, x: Any, pressure: Any) -> Any:
                seen[:] = [self.loop.powers(time, x, pressure, getattr(plant, "direction", 1))]
                return plant(time, x, pressure)

            return ca.vertcat(motion(watched, passed, now[:size]), seen[0])

        end = self.loop.advance(method, with_powers, ca.vertcat(state, ca.SX.zeros(len(WORKS))), step)
        self.works = self.works + end[size:]
        return end[:size]

    def advance_often(self, method: Any, motion: Any, given: Any, state: Any, step: float, times: int) -> Any:
        """See `Stepped.advance_often`."""
        state, self.works = self.loop.metered_often(method, motion, given, (state, self.works), step, times)
        return state


class Metered(Stepped):
    """A loop whose forces do work that can be integrated along with its motion; functions on CasADi SX.

    Attributes
    ----------
    load : Load
    factors : tuple of float or SX
        True over nominal parameters; empty for the nominal fault.
    """

    load: Load
    factors: tuple[Any, ...]

    @property
    @abstractmethod
    def friction(self) -> Any:
        """Function x [m, m/s] → friction coefficient [-]."""

    @property
    @abstractmethod
    def static_friction(self) -> Any:
        """Friction coefficient [-] on the verge of slip."""

    @property
    @abstractmethod
    def shaken(self) -> Any:
        """Function (t [s], x [m, m/s]) → φ̂_e [m/s²]."""

    def powers(self, time: Any, x: Any, pressure: Any, direction: Any = 1) -> Any:
        """Integrands per unit mass in the order of `WORKS` (SX): [W/kg], and x1 [m] for the last.

        Friction counts relative to its static value under the whole normal stress, whose work is exact in the slip; it
        acts against `direction`.
        """
        _, normal, damping, stress = self.hats()
        rate, relief = (ca.fabs(x[1]), ca.fmin(pressure, stress)) if self.sticks else (x[1], pressure)
        friction, way = self.friction(ca.vertcat(x[0], rate)), direction * x[1]
        return ca.vertcat(
            normal * stress * (friction * way - self.static_friction * x[1]),
            normal * friction * relief * way,
            damping * x[1] * x[1],
            self.shaken(time, x) * x[1],
            x[0],
        )

    def budget(self, integrals: Mapping[str, float], time: float, slip: float, rate: float) -> EnergyBudget:
        """Budget of a run from rest that has taken a time [s], from the integrals of `powers` and its last state."""
        mass, drift = self.fault.mass, self.load.drift
        stiffness, normal, damping, stress = self.hats()
        static = normal * stress * float(self.static_friction)
        tension, opened = static - damping * drift, drift * time - slip
        pull = tension * time + stiffness * (drift * time**2 / 2 - integrals["sum_slip"]) + damping * opened
        return EnergyBudget(
            kinetic=mass * rate**2 / 2,
            elastic=mass * (tension + stiffness * opened / 2) * opened,
            frictional=mass * (integrals["work_weakening"] + static * slip - integrals["work_injection"]),
            injection=mass * integrals["work_injection"],
            viscous=mass * (integrals["work_viscous"] + damping * drift * (drift * time - 2 * slip)),
            far_field=mass * drift * pull,
            disturbance=mass * integrals["work_disturbance"],
        )

    def hats(self) -> tuple[Any, Any, Any, float]:
        """k̂ [1/s²], N̂ [m²/kg], η̂ [1/s] with the factors of the loop, and σ' [Pa]."""
        numbers = plant.plant_values(self.fault)
        stiffness, damping, authority = self.factors[:3] or (1.0,) * 3
        k, eta, N, sigma = (float(numbers[s]) for s in (plant.k_hat, plant.eta_hat, plant.N_hat, plant.sigma))
        return k * stiffness, N * authority, eta * damping, sigma

"""Linear laws that run once per sample."""

from typing import ClassVar

from quakedesign.certificates import Certificate
from quakedesign.certificates.guarantee import Guarantee, Held, NoGuarantee, Task
from quakedesign.certificates.guarantee.held import Around
from quakedesign.certificates.premises import Domain, Premise
from quakedesign.fault import Fault
from quakedesign.loop import SampledController
from quakedesign.synthesis.guaranteed import best_guarantee
from quakedesign.synthesis.methods.base import Designed, Method, Problem


class Samples(Method[SampledController]):
    """Laws without a loop in continuous time: what is guaranteed of them as they run is all."""

    name: ClassVar[str] = "samples"
    family: ClassVar[type] = SampledController

    def assess(self, problem: Problem[Designed], controller: SampledController) -> Designed:
        """By the guarantee."""
        return problem.judged(controller, runs=self.guarantee(problem.fault, problem.task, controller, problem.noise))

    def premises(
        self, fault: Fault, controller: SampledController, certificate: Certificate | None
    ) -> tuple[tuple[Premise, ...], Domain | None]:
        """None: those of the guarantee stand with it."""
        return (), None

    def guarantee(
        self, fault: Fault, task: Task, controller: SampledController, noise: Around
    ) -> Guarantee | NoGuarantee:
        """At its own T_s, behind its own delay, lag and rock."""
        return best_guarantee(task, Held(law=controller.law, step=controller.step, **controller.sampling.path, **noise))

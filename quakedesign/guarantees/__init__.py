"""Proved peaks of sampled loops: norms of the nominal loop, robust small-gain theorem.

Reading order: the plant with its ranges and symbols (`plant.fault_plant`); its loop with a law (`loop.error_loop`,
`exact.sampled_loop`); L1 norms of the nominal loop (`exact.norms`); the theorem (`exact.small_gain`); claims, their
check and the printed statement (`exact.tracking_proof`), with an invariant set for aperiodic sampling
(`exact.invariant_set`). The stick–slip plant has an invariant polytope, for laws of another structure
(`exact.stick_slip_set`, `exact.stick_slip_proof`), slow sliding another theorem (`exact.sliding_small_gain`,
`exact.sliding_proof`), a user-defined plant a vector small-gain theorem (`exact.plant_proof`). `synthesis.guarantee`
chooses the theorem, `search` proposes laws and sets, `result` and `*_result` define the results of
`quakedesign.guarantee`.
"""

from quakedesign.arguments import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)

"""What a reference and a disturbance put into the error loop, against the worst friction of the box."""

import numpy as np

import quakedesign as qd
from quakedesign.certificates.linear_premises import sectors
from quakedesign.certificates.tracking import tracking_inputs
from quakedesign.controllers import published

REAL = qd.load_fault("real-fault")


def test_the_drift_is_that_of_the_worst_friction_but_for_a_tenth():
    # friction falls as steeply as the box allows and ends where r' is largest; p* by hand from the balance at rest
    law, N, sigma, task = REAL.friction, REAL.authority, REAL.effective_normal_stress, REAL.reference
    s = np.linspace(0, 1, 200001)
    r = task.target_slip * s**3 * (10 - 15 * s + 6 * s**2)
    begin = task.target_slip / 2 - law.critical_slip
    assert begin > 0
    mu = law.residual + law.drop * np.clip(1 - (r - begin) / law.critical_slip, 0, 1)
    spring = REAL.specific_stiffness - REAL.disturbance.slip_growth
    rest = ((mu - mu[0]) * N * sigma + spring * r) / (mu * N)
    worst = np.abs(np.gradient(rest, s * task.operation_time)).max()
    bound = float(tracking_inputs(REAL, published("real-fault")["elqr"], sectors(REAL))["drift"])
    assert 0.9 * bound < worst <= bound

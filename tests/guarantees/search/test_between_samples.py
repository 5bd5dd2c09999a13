"""The worst case found between samples, against the sum of absolute responses of a loop with a delay."""

from dataclasses import replace
from fractions import Fraction as F
from itertools import product

import numpy as np
from scipy.linalg import expm

import quakedesign as qd
from quakedesign.guarantees import SampledLoop, guarantee
from quakedesign.guarantees.search.worst_case import worst_tracking
from quakedesign.laws import LinearLaw
from quakedesign.plant import uncertain_plant

PARTS, PERIODS = 16, 60
GAINS = np.array([6e8, 3.5e8, 3e7])  # of slip [Pa/m], slip rate [Pa s/m] and the sum of slips [Pa/m]
STEP, DELAY = F("0.184"), F("0.023")  # a delay of two of the 16 parts of a period


def sums_of_responses(chord, damping, gain):
    """Of slip and slip rate at each part of a period: Σ|response| to accelerations that are constant in each part."""
    flow = np.array([[0, 1, 0, 0], [chord, -damping, gain, 1], [0, 0, 0, 0], [0, 0, 0, 0]], dtype=float)
    moved = expm(flow * float(STEP) / PARTS)[:2]
    errors, integral, waiting, applied = np.zeros((PARTS, 2)), np.zeros(PARTS), np.zeros(PARTS), np.zeros(PARTS)
    found = np.zeros((2, PARTS))
    for part in range(PERIODS * PARTS):
        if part % PARTS == 0:
            waiting = -errors @ GAINS[:2] - GAINS[2] * integral
            integral = integral + errors[:, 0]
        if part % PARTS == DELAY / STEP * PARTS:
            applied = waiting
        pushed = (np.arange(PARTS) == part).astype(float)
        errors = np.column_stack([errors, applied, pushed]) @ moved.T
        found[:, (part + 1) % PARTS] += abs(errors).sum(axis=0)
    return found


def test_the_worst_case_between_samples_is_no_less_than_the_sum_of_responses():
    task = uncertain_plant(qd.load_fault("real-fault"))
    one = replace(task.friction, static=F("0.3"), least=F("0.3"), largest=F("0.3"), weakening=F("0.1"))
    task = replace(task, friction=one)
    law = LinearLaw(
        states=("z",),
        update=((F(1),),),
        measured=((F(1), F(0)),),
        output=(F(-GAINS[2]),),
        feedback=(F(-GAINS[0]), F(-GAINS[1])),
    )
    found = guarantee(task, SampledLoop(law=law, step=STEP, delay=DELAY))
    worst = worst_tracking(found)
    size = float(task.amplitude + task.reference_force)
    ends = product(task.slip_chord, task.rate_chord)
    sums = size * np.max([sums_of_responses(float(s), float(w), float(task.authority)) for s, w in ends], axis=0)
    assert sums[1].max() > 1.05 * sums[1, 0]  # the slip rate peaks between samples
    assert sums[0].max() <= worst.slip_error <= found.claims.slip_error
    assert sums[1].max() <= worst.slip_rate_error <= found.claims.slip_rate_error

"""Blocks in slow sliding beside their nonlinear equations, and runs of these beside what is proved."""

import json
import re
from dataclasses import fields, replace
from fractions import Fraction as F
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import quakedesign as qd
from quakedesign.cli import main
from quakedesign.errors import QuakedesignError
from quakedesign.exact import UpperBound
from quakedesign.fault.friction import rate_and_state as friction_laws
from quakedesign.guarantees.exact.guarantee_files import guarantee_document
from quakedesign.guarantees.exact.plant_proof import PlantClaims, PlantProof
from quakedesign.guarantees.exact.sliding_blocks import BlockClaims, SlidingBlocks
from quakedesign.guarantees.search import sliding_block_design

PATH = Path(__file__).parents[2] / "data" / "three_sliding_blocks.toml"
CHAIN = qd.load_chain(PATH)
V, D, A, B, MU, STRESS, LAG = 1e-6, 8e-3, 0.01, 0.015, 0.6, 50e6, 800.0
RADIATION = 1.0405e15 / 15e3**2 * V
K, SPRING = 32.04e9 / 15e3, 32.04e9 * 15e3 / 5e3**2
CLAIMS = BlockClaims(log_state=F("0.02"), pull=F(30000), push=F(200000))
BLOCKS = SlidingBlocks(chain=CHAIN, lag=F(800), stress=F(10000))


def log_rate(normal, z, force):
    """The y of a block by its balance of forces, N(ay + bz) + HV(e^y − 1) = force."""
    y = np.zeros_like(force)
    for _ in range(50):
        y = y - (normal * (A * y + B * z) + RADIATION * np.expm1(y) - force) / (normal * A + RADIATION * np.exp(y))
    return y


def test_rates_of_slip_and_state_lie_within_the_sectors():
    plant, bound = BLOCKS.plant(CLAIMS), float(BLOCKS.log_rate(CLAIMS))
    random, count = np.random.default_rng(3), 20000
    ends = [float(v) for v in (CLAIMS.log_state, CLAIMS.pull, 10000)]
    z, w, s = (end * random.choice([-1, 1], count) * random.choice([1, 1, 0.3], count) for end in ends)
    normal = STRESS - np.where(random.random(count) < 0.5, K / MU + 2e5, -2e5)
    y = log_rate(normal, z, w + s)
    assert np.abs(y).max() <= bound
    assert np.abs(y).max() > 0.8 * bound
    first, second, third = (
        [float(v) for v in plant.sectors[name].slopes]
        for name in ("rate of block 1 by its state", "rate of block 1 by its pull", "ageing of block 1")
    )
    second = [v / 1e6 for v in second]  # 1/MPa in the plant
    low = np.minimum(-first[0] * z, -first[1] * z) + np.minimum(second[0] * (w + s), second[1] * (w + s))
    high = np.maximum(-first[0] * z, -first[1] * z) + np.maximum(second[0] * (w + s), second[1] * (w + s))
    assert (low <= np.expm1(y)).all()
    assert (np.expm1(y) <= high).all()
    aged = -np.expm1(-z) / z
    assert third[0] <= aged.min()
    assert aged.max() <= third[1]
    assert third == pytest.approx([aged.min(), aged.max()], rel=1e-8)
    assert {one.within for name, one in plant.sectors.items() if "pull" not in name} == {CLAIMS.log_state}
    # a disturbance is what the stress adds to f at most
    (entry, size) = plant.disturbances["stress on block 1"]
    assert float(size) >= second[1] * 10000
    assert [float(v) for v in entry[:4]] == pytest.approx([V / D, 0, 0, -V / D])


def test_the_linear_part_is_that_of_the_springs_and_the_lag():
    plant = BLOCKS.plant(CLAIMS)
    pull = [float(v) for v in plant.sectors["rate of block 1 by its pull"].row]
    assert pull[:3] == pytest.approx([-(K + SPRING) * D / 1e6, SPRING * D / 1e6, 0])
    assert pull[6:9] == pytest.approx([MU, 0, 0])
    assert [float(v) for v in plant.A[6]] == pytest.approx([0] * 6 + [-1 / LAG, 0, 0])
    assert float(plant.B[6][0]) == pytest.approx(1 / LAG)
    assert plant.sectors["rate of block 1 by its pull"].within == CLAIMS.pull / 10**6


@pytest.mark.parametrize(("state", "pull"), [("0.02", 30_000), ("0.2", 1000)])
def test_the_largest_slip_rate_and_its_stress_are_consistent(state, pull):
    """Y is not below the y of the balance of forces at the ends of z, w and s, and is the one that inertia counts."""
    dense = replace(CHAIN.fault, density=2670e4, shear_modulus=32.04e9)
    blocks = SlidingBlocks(chain=replace(CHAIN, fault=dense), lag=F(800), stress=F(10000))
    claims = BlockClaims(log_state=F(state), pull=F(pull), push=F(200_000))
    found, Z, low = blocks._ranges(claims), float(state), STRESS - K / MU - 2e5
    for place, one in enumerate(found):
        Y, stress = float(one.log_rate), float(one.stress)
        (needed,) = log_rate(np.array([low]), np.array([-Z]), np.array([pull + stress]))
        assert needed <= Y <= 1.1 * needed
        moved, springs = 2 * 2e5 / LAG, K + SPRING * (4 if place == 1 else 2)
        change = (K / MU * V + moved) * (A * Y + B * Z) + (STRESS + 2e5) * B * V / D * (np.exp(Y) - np.exp(-Z))
        change += springs * V * np.expm1(float(max(other.log_rate for other in found))) + MU * moved
        assert stress - 1e4 == pytest.approx(change * 2670e4 * 15e3 * V * np.exp(Y) / (low * A), rel=3e-3)


def test_one_block_that_may_open_leaves_no_claim_for_the_others():
    weak = replace(CHAIN.blocks[1], effective_normal_stress=3.6e6)
    chain = replace(CHAIN, blocks=(CHAIN.blocks[0], weak, CHAIN.blocks[2]))
    assert SlidingBlocks(chain=chain, lag=F(800), stress=F(10000)).log_rate(CLAIMS) is None


@pytest.mark.parametrize("part", ["stiffness", "damping", "authority"])
def test_a_box_of_one_unknown_constant_is_refused(part):
    box = replace(CHAIN.fault.box, name="own", **{part: F(1, 10)})
    with pytest.raises(QuakedesignError, match="box paper"):
        SlidingBlocks(chain=replace(CHAIN, fault=replace(CHAIN.fault, box=box)), lag=F(800), stress=F(10000))


@pytest.mark.parametrize(("lag", "stress"), [(0, 1), (1, 0), (-1, 1), (1, -1)])
def test_lag_and_stress_are_positive(lag, stress):
    with pytest.raises(QuakedesignError, match="a positive lag and a positive bound"):
        SlidingBlocks(chain=CHAIN, lag=F(lag), stress=F(stress))


def test_inertia_is_a_stress_of_less_than_a_pascal_and_grows_with_the_mass():
    light = float(BLOCKS.plant(CLAIMS).disturbances["stress on block 2"][1])
    dense = replace(CHAIN.fault, density=2670e3, shear_modulus=32.04e9)
    heavy = SlidingBlocks(chain=replace(CHAIN, fault=dense), lag=F(800), stress=F(10000)).plant(CLAIMS)
    by_pull = float(BLOCKS.plant(CLAIMS).sectors["rate of block 2 by its pull"].slopes[1]) / 1e6
    assert 10000 < light / by_pull < 10001
    extra = float(heavy.disturbances["stress on block 2"][1]) / by_pull - 10000
    assert extra == pytest.approx(1000 * (light / by_pull - 10000), rel=0.05)
    told = heavy.remarks["disturbances"]
    own, more = re.search(r"due to ([0-9.]+) kPa of shear stress and up to ([0-9.]+) Pa of", told).groups()
    by_pull = float(heavy.sectors["rate of block 2 by its pull"].slopes[1]) / 1e6
    extra = float(heavy.disturbances["stress on block 2"][1]) / by_pull - 10000
    assert own == "10"
    assert extra * 0.99 < float(more) < extra * 1.01


def test_inertia_counts_the_pull_of_a_neighbour_that_is_faster():
    """A heavy rock, whose second block has less direct effect, and so slides faster."""
    dense = replace(CHAIN.fault, density=2670e4, shear_modulus=32.04e9)
    blocks = changed(1, direct_effect=0.004)
    plant = SlidingBlocks(chain=replace(CHAIN, fault=dense, blocks=blocks), lag=F(800), stress=F(10000)).plant(CLAIMS)
    slow, fast = (
        SlidingBlocks(chain=replace(CHAIN, fault=dense, blocks=(one,) * 3), lag=F(800), stress=F(10000))
        for one in (blocks[0], blocks[1])
    )
    own, other = (float(np.exp(float(one.log_rate(CLAIMS)))) for one in (slow, fast))
    assert other > 1.15 * own
    least = STRESS - K / MU - 2e5
    inertia = 2670e4 * 15e3 * V * own / (least * A)  # 1/λ₀ [s]
    by_pull = float(plant.sectors["rate of block 1 by its pull"].slopes[1]) / 1e6
    found = float(plant.disturbances["stress on block 1"][1]) / by_pull
    alone = float(slow.plant(CLAIMS).disturbances["stress on block 1"][1])
    alone /= float(slow.plant(CLAIMS).sectors["rate of block 1 by its pull"].slopes[1]) / 1e6
    assert found - alone >= SPRING * V * (other - own) * inertia
    assert found - alone > 1


def test_the_pull_of_a_fast_pressure_counts_as_inertia():
    """|q'| <= 2Q/lag, and sup|r| of which mu*|q'| is a part is multiplied by mVe^Y/(Na)."""
    quick = SlidingBlocks(chain=CHAIN, lag=F(1, 100), stress=F(10000))
    by_pull = float(quick.plant(CLAIMS).sectors["rate of block 1 by its pull"].slopes[1]) / 1e6
    extra = float(quick.plant(CLAIMS).disturbances["stress on block 1"][1]) / by_pull - 10000
    moved = 2 * 2e5 / 0.01
    a_y = A * float(quick.log_rate(CLAIMS)) + B * float(CLAIMS.log_state)
    wanted = (MU + a_y) * moved * 2670 * 15e3 * V * np.exp(float(quick.log_rate(CLAIMS)))
    assert extra == pytest.approx(wanted / ((STRESS - K / MU - 2e5) * A), rel=1e-3)


def test_what_is_left_open_of_the_steady_coefficient_counts_as_stress():
    open_to = SlidingBlocks(chain=CHAIN, lag=F(800), stress=F(10000))
    ends = (F("0.59"), F("0.61"))
    tasks = tuple(replace(t, ranges={**t.ranges, "coefficient": ends}) for t in BLOCKS.tasks)
    vars(open_to)["tasks"] = tasks
    stresses = [float(one._ranges(CLAIMS)[0].stress) for one in (BLOCKS, open_to)]
    assert stresses[1] - stresses[0] == pytest.approx(0.01 * (2e5 + K * 1.0 / 0.59), rel=1e-3)


def test_a_reference_that_swings_moves_every_block():
    task = replace(CHAIN.fault.reference, ramp=0.05)
    swinging = SlidingBlocks(
        chain=replace(CHAIN, fault=replace(CHAIN.fault, reference=task)), lag=F(800), stress=F(10000)
    ).plant(CLAIMS)
    entry, size = swinging.disturbances["reference of block 3"]
    first = 1e-6 * 0.95  # V [m/s]
    assert float(size) == pytest.approx(first / D * 15 / 8 * 0.05 / 0.95)
    assert entry == tuple(F(i == 2) for i in range(9))


def test_a_pressure_beyond_its_claim_proves_nothing(monkeypatch):
    class Search:
        """Stands for the search of weights."""

        def __init__(self, *_):
            pass

        def log_rate(self, _):
            return 1.0

        def closed(self, _):
            return object(), CLAIMS, 0.5

    found = object.__new__(PlantProof)
    object.__setattr__(found, "claims", PlantClaims(outputs=(), controls=(UpperBound(1),)))  # MPa, beyond 0.2
    monkeypatch.setattr(sliding_block_design, "_WeightSearch", Search)
    monkeypatch.setattr(sliding_block_design, "plant_guarantee", lambda *_: found)
    none = sliding_block_design.sliding_block_guarantee(BLOCKS, F(400))
    assert none.reason == "the proof failed for the estimated bounds: reduce the stress"


def test_claims_under_which_a_block_may_open_give_no_plant():
    assert BLOCKS.plant(replace(CLAIMS, push=F(48 * 10**6))) is None
    assert BLOCKS.log_rate(replace(CLAIMS, pull=F(10**8))) is None


def worst_signs(found, block, periods):
    """Signs of the stresses, one a period and block, that add up to the largest y of a block in the linear loop."""
    loop, step = found.part.loop(found.law), float(found.law.step)
    flow, jump = np.array(loop.flow, dtype=float), np.array(loop.segments[0][0], dtype=float)
    size, entered = len(flow), np.array(loop.inputs[:3], dtype=float).T
    held = expm(np.block([[flow, entered], [np.zeros((3, size + 3))]]) * step)
    period, moved = held[:size, :size] @ jump, held[:size, size:]
    row = np.zeros(size)
    for place, sign in ((3 * block, -1), (3 * block + 1, 1)):  # γα of z, and γκ of w
        sector = found.part.sectors[place]
        row[: len(sector.row)] += sign * float(sum(sector.slopes)) / 2 * np.array(sector.row, dtype=float)[:size]
    signs = np.empty((periods, 3))
    for k in reversed(range(periods)):
        signs[k], row = np.sign(row @ moved), row @ period
    return signs


def nonlinear_run(law, shares, weights, stress, signs, plan=K / MU):
    """Largest slip error, |y|, |z| and pressures of the nonlinear blocks under stresses that switch."""
    N, step = 3, float(law.step)
    F_, G, H, D_ = (np.array(part, dtype=float) for part in (law.update, law.measured, law.output, law.feedback))
    laplacian = SPRING * np.array([[-1, 1, 0], [1, -2, 1], [0, 1, -1.0]])
    x, z, q, memory = np.zeros(N), np.zeros(N), np.zeros(len(shares.T)), np.zeros(len(F_))
    largest = np.zeros((4, N))
    for k, sign in enumerate(signs):
        seen = weights @ x
        u = 1e6 * (H @ memory + D_ @ seen)
        memory = F_ @ memory + G @ seen
        s = stress * sign

        def rates(t, state, s=s, u=u, began=k * step):
            x, z, q = state[:3], state[3:6], state[6:]
            normal = STRESS - plan * V * (began + t) - shares @ q
            y = log_rate(normal, z, s - K * x + laplacian @ x + MU * shares @ q)
            f = np.expm1(y)
            return np.r_[V * f, -V / D * (f - np.expm1(-z)), (u - q) / LAG]

        run = solve_ivp(rates, (0, step), np.r_[x, z, q], method="LSODA", rtol=1e-8, atol=1e-12)
        x, z, q = run.y[:3, -1], run.y[3:6, -1], run.y[6:, -1]
        normal = STRESS - plan * V * (k + 1) * step - shares @ q
        y = log_rate(normal, z, s - K * x + laplacian @ x + MU * shares @ q)
        largest[:3] = np.maximum(largest[:3], np.abs([x, y, z]))
        largest[3, : len(u)] = np.maximum(largest[3, : len(u)], np.abs(u))
    return largest


@pytest.mark.slow
@pytest.mark.parametrize(
    ("wells", "stress", "step", "most", "kind"),
    [
        ((2500.0, 7500.0, 12500.0), "10000", "400", 0.08, "centralised"),
        ((2500.0, 7500.0, 12500.0), "10000", "400", 0.08, "decentralised"),
        ((2500.0, 12500.0), "1000", "1600", 0.05, "centralised"),
    ],
    ids=["three wells", "decentralised", "two wells"],
)
def test_nonlinear_blocks_stay_within_what_is_proved_and_both_checkers_decide(wells, stress, step, most, kind, checker):
    chain = replace(CHAIN, wells=wells)
    found = qd.guarantee(chain, kind, stress=stress, lag="800", step=step).proof
    assert found.available
    for part in (found.law.update, found.law.measured, found.law.output, found.law.feedback):
        apart = all(not v or i % 3 == j % 3 for i, row in enumerate(part) for j, v in enumerate(row))
        assert apart is (kind == "decentralised")
    document = guarantee_document(found)
    assert checker.check(json.dumps(document)).verdict == "proved"
    told = float(found.notes[0].split("|ln(v/V)| <= ")[1].split()[0])
    assert told <= most
    shares = np.array(chain.shares, dtype=float)
    weights = np.eye(3) if len(wells) == 3 else (shares / shares.sum(axis=0)).T
    attacks = [worst_signs(found, block, 300) for block in range(3)]
    worst = np.max([nonlinear_run(found.law, shares, weights, float(stress), signs) for signs in attacks], axis=0)
    bounds = np.array([float(v) for v in found.claims.outputs])
    assert (worst[0] <= bounds[:3]).all()
    assert worst[1].max() <= told
    assert worst[1].max() > 0.3 * told
    assert (worst[2] <= bounds[3:6]).all()
    assert worst[3].max() <= 1e6 * float(max(found.claims.controls))


def run(*arguments):
    with pytest.raises(SystemExit) as stop:
        main([*map(str, arguments)])
    return stop.value.code


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("guarantee", PATH), "needs stress (--stress) and lag (--lag"),
        (("guarantee", PATH, "--stress", "10 kPa"), "positive lag and a positive bound of the shear stress"),
        (("guarantee", PATH, "--stress", "10 kPa", "--lag", "800 s", "--delay", "1 s"), "Received --delay"),
        (("design", PATH, "--out", "unwritten"), "needs stress (--stress) and lag (--lag"),
        (("design", PATH, "--stress", "10 kPa", "--out", "unwritten"), "positive lag and a positive bound"),
        (("compare", PATH), "needs stress (--stress) and lag (--lag"),
        (("guarantee", PATH, "--stress", "1 kPa", "--lag", "8 s", "--controller", "dia"), "centralised, decentralised"),
        (("guarantee", PATH, "--stress", "1 kPa", "--lag", "8 s", "--box", "ten-percent"), "box paper"),
        (("guarantee", PATH.with_name("three_blocks.toml"), "--lag", "1 s"), "need friction with a state"),
    ],
)
def test_what_does_not_apply_is_refused_in_one_line(arguments, said, capsys):
    assert run(*arguments) == 2
    assert said in " ".join(capsys.readouterr().err.split())
    assert not Path("unwritten").exists()


@pytest.mark.parametrize(
    ("option", "said"),
    [
        ({"objective": "peak"}, "objective 'peak'"),
        ({"scheme": "explicit"}, "scheme 'explicit'"),
        ({"scheme": ""}, "scheme ''"),
        ({"disturbance_class": "rate"}, "class 'rate'"),
        ({"plant": "stick-slip"}, "plant 'stick-slip'"),
        ({"gains": [1, 2, 3, 4]}, "gains"),
        ({"spread": "0.1"}, "spread 1/10"),
        ({"controller": "cta"}, "controller 'cta'"),
        ({"delay": "1 s", "objective": "peak"}, "objective 'peak', delay"),
        ({"stress": None}, "no stress"),
    ],
)
def test_options_that_are_not_used_are_refused(option, said):
    with pytest.raises(QuakedesignError, match=rf"takes only step .*Received {re.escape(said)}\.$"):
        qd.guarantee(CHAIN, **{"stress": "1 kPa", "lag": "800"} | option)


def test_blocks_whose_record_does_not_support_their_friction_are_refused_unless_that_is_accepted():
    poor = replace(CHAIN, fault=replace(CHAIN.fault, poor_fit="residuals are 3 times the noise"))
    with pytest.raises(QuakedesignError, match="residuals are 3 times the noise"):
        qd.guarantee(poor, stress="1 kPa", lag="800")
    with pytest.raises(QuakedesignError, match="a positive lag"):  # goes on
        qd.guarantee(poor, stress="1 kPa", accept_poor_fit=True)


def changed(place, **values):
    blocks = list(CHAIN.blocks)
    friction = replace(blocks[place].friction, **values)
    return tuple(replace(one, friction=friction) if i == place else one for i, one in enumerate(blocks))


def of_law(name):
    values = {field.name: getattr(CHAIN.blocks[0].friction, field.name) for field in fields(CHAIN.blocks[0].friction)}
    law = getattr(friction_laws, name)
    friction = law(**{key: value for key, value in values.items() if key in law.__dataclass_fields__})
    return replace(CHAIN, blocks=tuple(replace(one, friction=friction) for one in CHAIN.blocks))


@pytest.mark.parametrize(
    ("chain", "said"),
    [
        (replace(CHAIN, blocks=changed(1, reference_coefficient=0.61)), "one steady friction coefficient"),
        (
            replace(CHAIN, blocks=changed(1, critical_slip=7e-3), wells=(2500.0,)),
            "must be identical if there are fewer wells",
        ),
        (replace(CHAIN, wells=(1000.0, 2000.0)), "wells that act independently"),
        (replace(CHAIN, blocks=changed(1, stress_sensitivity=0.1)), "stress_sensitivity 0"),
        (of_law("RateAndStateSlip"), "need rate-and-state-aging friction. Received rate-and-state-slip in block 1"),
        (of_law("RegularisedRateAndState"), "Received regularised-rate-and-state in block 1"),
        (
            replace(
                CHAIN,
                fault=replace(CHAIN.fault, length=14e3),
                blocks=(replace(CHAIN.blocks[0], length=1000.0),) * 14,
                wells=(500.0,),
            ),
            "must be 2 to 13. Received 14",
        ),
    ],
)
def test_blocks_that_are_not_covered_are_refused(chain, said):
    with pytest.raises(QuakedesignError, match=said):
        SlidingBlocks(chain=chain, lag=F(800), stress=F(10000))

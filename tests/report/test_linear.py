"""Sentences about an e-LQR say what was decided."""

from types import SimpleNamespace

import pytest

from quakedesign.report.linear import held_sentence, peaks_sentence

HELD = {
    "step": 0.184, "verdict": "proved", "varying": "proved", "summed": "proved", "radius": 0.9, "witness": None,
    "largest_step": 0.27,
}  # fmt: skip


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({}, "stable if p is held over T_s = 0.184 s, proved for any course of the parameters; every T_s up to 0.27 s"),
        ({"varying": "undecided"}, "proved for constant parameters"),
        ({"summed": "refuted"}, "any course of the parameters, but UNSTABLE with integrals summed from the samples"),
        (
            {"verdict": "refuted", "witness": [1.4, -0.5, 1.6]},
            "UNSTABLE if p is held over T_s = 0.184 s (at β = 1.4",
        ),
        ({"verdict": "undecided", "largest_step": None}, "undecided if p is held over T_s = 0.184 s; no T_s is proved"),
    ],
)
def test_a_held_pressure(changed, said):
    assert said in held_sentence(HELD | changed)


def test_peaks_of_one_or_no_class():
    peaks = SimpleNamespace(peak_slip_rate=0.25, total=lambda output: {"slip_error": 0.5}[output])
    said = peaks_sentence({"rate": peaks, "amplitude": None})
    assert said.endswith("slip rate below 0.25 m/s (slip error 0.5 m) for one of its amplitude and rate")
    assert peaks_sentence({"rate": None}) == "no bound on the slip rate is certified"

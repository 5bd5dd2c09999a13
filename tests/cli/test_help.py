"""What the help texts promise is what there is."""

import re

import pytest

from quakedesign.cli import main
from quakedesign.fault import BOXES, presets
from quakedesign.laws import control_laws
from quakedesign.laws.feed_forward import FEED_FORWARDS
from quakedesign.loop import schemes
from quakedesign.loop.loop_setup import MEASURED
from quakedesign.simulation import integrators
from quakedesign.synthesis import designable

CHOICES = {
    "simulate": (control_laws(), schemes(), integrators(), FEED_FORWARDS, presets()),
    "campaign": (control_laws(), schemes(), FEED_FORWARDS, BOXES),
    "design": (designable(), schemes(), MEASURED[:2], BOXES),
    "export": (control_laws(), FEED_FORWARDS),
    "guarantee": (designable(), MEASURED, BOXES),
    "fault": (presets(), BOXES),
}


@pytest.mark.parametrize("command", CHOICES)
def test_help_names_every_choice_that_there_is(command, capsys):
    with pytest.raises(SystemExit) as stop:
        main([command, "--help"])
    assert stop.value.code == 0
    told = set(re.findall(r"[\w-]+", capsys.readouterr().out))
    assert {name for names in CHOICES[command] for name in names} <= told

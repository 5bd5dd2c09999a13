"""Design controllers that let a fault slip slowly instead of in an earthquake, and prove that they do.

The public names load on first use, so that ``import quakedesign`` costs nothing; ``__init__.pyi`` names them for tools.
"""

from importlib import import_module as _import_module

_HOME = {
    "Certificate": "lyapunov",
    "Controller": "laws",
    "Design": "synthesis",
    "Disturbance": "fault",
    "Fault": "fault",
    "FrictionLaw": "fault",
    "LoopSetup": "loop.loop_setup",
    "Reference": "fault",
    "Scales": "fault",
    "Trajectory": "simulation",
    "UncertaintyBox": "fault",
    "Verdict": "lyapunov",
    "assess": "synthesis",
    "campaign_problem": "simulation.campaign",
    "certify": "lyapunov",
    "check_files": "checking",
    "compare": "report",
    "derive": "symbolic",
    "design": "synthesis",
    "export_controller": "simulation",
    "guarantee": "synthesis",
    "identify": "identification",
    "limits": "studies",
    "load_certificate": "lyapunov",
    "load_fault": "fault",
    "load_guarantee": "guarantees",
    "loop_margins": "simulation",
    "loop_transfer": "simulation",
    "published": "laws",
    "run_campaign": "simulation.campaign",
    "scaled_fault": "fault",
    "simulate": "simulation",
    "stated_problems": "synthesis",
    "synthesise": "lyapunov",
    "to_casadi": "simulation",
    "to_iosystem": "simulation",
    "to_statespace": "simulation",
}

__all__ = list(_HOME)


def __getattr__(name: str) -> object:
    if name == "__version__":
        return _import_module("importlib.metadata").version("quakedesign")
    if name not in _HOME:
        raise AttributeError(f"module 'quakedesign' has no attribute {name!r}")
    return getattr(_import_module(f"quakedesign.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]

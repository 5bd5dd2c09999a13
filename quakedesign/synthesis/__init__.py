"""Every search: gains with a proof, and verdicts on given gains."""

from quakedesign.synthesis.design import DESIGNABLE, Design, assess, certify, design

__all__ = ["DESIGNABLE", "Design", "assess", "certify", "design"]

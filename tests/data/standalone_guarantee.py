"""The checker's modules for guarantees as one module with all their names; a patch applies to all of them."""

import importlib.util
from pathlib import Path
from types import ModuleType

PATH = Path(__file__).parents[2] / "proofs" / "check.py"
SPECIFICATION = importlib.util.spec_from_file_location("check_of_guarantees", PATH)
CHECK = importlib.util.module_from_spec(SPECIFICATION)
SPECIFICATION.loader.exec_module(CHECK)
NAMES = ("reading", "task", "matrices", "root", "loop", "impulse_sums", "gains", "bounds", "invariant_set", "tracking")
MODULES = [CHECK.beside(f"guarantee.{name}") for name in NAMES]


class Checker(ModuleType):
    def __setattr__(self, name, value):
        super().__setattr__(name, value)
        for module in MODULES:
            if hasattr(module, name):
                setattr(module, name, value)


checker = Checker("guarantees")
for part in MODULES:
    vars(checker).update(vars(part))

"""The checker of the standard library, as a module."""

import importlib.util
import sys
from pathlib import Path

import pytest

CHECK = Path(__file__).parents[3] / "proofs" / "check.py"


@pytest.fixture(scope="module")
def checker():
    """proofs/check.py, which decides texts by ``check``."""
    specification = importlib.util.spec_from_file_location("check_plants", CHECK)
    module = importlib.util.module_from_spec(specification)
    sys.modules["check_plants"] = module
    specification.loader.exec_module(module)
    yield module
    del sys.modules["check_plants"]

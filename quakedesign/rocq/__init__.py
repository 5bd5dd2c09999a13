"""Certificates for a proof assistant: files that Rocq's compiler, ``coqc``, verifies by itself."""

from quakedesign.arguments import check_arguments
from quakedesign.rocq.rocq_export import rocq_text, write_rocq

__all__ = ["rocq_text", "write_rocq"]

check_arguments(__name__)

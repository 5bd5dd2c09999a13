"""Linear feedback that holds where Theorem 2 as printed does not: bounds, design, analysis, sampled implementation."""

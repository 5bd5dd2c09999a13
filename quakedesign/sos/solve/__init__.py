"""Search for proofs about polynomials in floating point; `quakedesign.sos.exact` checks them."""

"""The part of the engine that searches: floating point proposes, `sos.exact` decides."""

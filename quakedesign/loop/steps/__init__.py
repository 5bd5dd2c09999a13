"""What the schemes that sample share: a law at one sample, the implicit step, and the pressure that is held."""

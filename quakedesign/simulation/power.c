
/* Exponents are nearly always known when this is compiled, and one of both is all that is left. */
PORTABLE double portable_power(double x, double a) {
  if (a == ${third}) return portable_cube_root(x);
  return portable_any_power(x, a);
}

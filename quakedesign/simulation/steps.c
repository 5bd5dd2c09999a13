
EXPORTED int advance(double* vector, long long steps) {
  double first[${size}], second[${size}], work[${work}];
  casadi_int integers[${integers}];
  const double* arguments[${arguments}];
  double* results[${results}];
  double *now = first, *next = second, *other;
  long long taken;
  int i;
  for (i = 0; i < ${size}; ++i) now[i] = vector[i];
  for (taken = 0; taken < steps; ++taken) {
    arguments[0] = now;
    results[0] = next;
    if (${step}(arguments, results, integers, work, 0)) return 1;
    other = now;
    now = next;
    next = other;
  }
  for (i = 0; i < ${size}; ++i) vector[i] = now[i];
  return 0;
}

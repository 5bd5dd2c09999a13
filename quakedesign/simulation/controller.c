
#include "${header}"

void controller_reset(double* memory) {
  static const double start[CONTROLLER_MEMORY] = {
${start}
  };
  int i;
  for (i = 0; i < CONTROLLER_MEMORY; ++i) memory[i] = start[i];
}

void controller_step(const double* measurement, ${applied}double* memory, double* pressure) {
  const double* arguments[${arguments}] = {measurement, ${given}memory};
  double after[CONTROLLER_MEMORY];
  double* results[${results}] = {after, pressure};
  casadi_int integers[${integers}];
  double work[${work}];
  int i;
  sampled_step(arguments, results, integers, work, 0);
  for (i = 0; i < CONTROLLER_MEMORY; ++i) memory[i] = after[i];
}

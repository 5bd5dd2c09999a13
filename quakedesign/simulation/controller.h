#ifndef CONTROLLER_H
#define CONTROLLER_H

#define CONTROLLER_STEP ${step} /* s */
#define CONTROLLER_MEASUREMENTS ${measurements}
#define CONTROLLER_MEMORY ${memory}

#ifdef __cplusplus
extern "C" {
#endif

/* Memory before the first call. */
void controller_reset(double* memory);

/* One sample: measurement and the pressure [Pa] applied since the last call in, memory updated, pressure [Pa] out.
   applied may be a null pointer: then it was the pressure of the last call. Before the first call it is 0. */
void controller_step(const double* measurement, const double* applied, double* memory, double* pressure);

#ifdef __cplusplus
}
#endif

#endif

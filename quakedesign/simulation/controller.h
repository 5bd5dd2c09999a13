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

/* One sample: measurement in, memory updated, pressure [Pa] out. */
void controller_step(const double* measurement, double* memory, double* pressure);

#ifdef __cplusplus
}
#endif

#endif

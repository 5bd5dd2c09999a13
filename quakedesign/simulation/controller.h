#ifndef CONTROLLER_H
#define CONTROLLER_H

#define CONTROLLER_STEP ${step} /* s */
#define CONTROLLER_MEASUREMENTS ${measurements}
#define CONTROLLER_MEMORY ${memory}
#define CONTROLLER_PRESSURES ${pressures}
#define CONTROLLER_LIMITED ${limited} /* whether applied is an argument */

#ifdef __cplusplus
extern "C" {
#endif

/* Memory before the first call. */
void controller_reset(double* memory);

/* One sample: measurement${inputs} in, memory updated, pressure [Pa] out.${about} */
void controller_step(const double* measurement, ${applied}double* memory, double* pressure);

#ifdef __cplusplus
}
#endif

#endif

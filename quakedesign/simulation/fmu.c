/* A sampled controller as a model unit of FMI 2.0 for co-simulation: one instance owns its memory and its signals.
   The samples lie at start + k CONTROLLER_STEP. A step from t to t + h takes every sample in [t, t + h) with the
   measurement that was set before, and the pressure is held from each sample to the next. A sample takes the applied
   pressure that was set last, once one was set after initialisation; before that, the commanded pressure counts as
   applied. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "controller.h"

#if defined(_WIN32)
#define EXPORTED __declspec(dllexport)
#else
#define EXPORTED __attribute__((visibility("default")))
#endif
#define PRESSURE CONTROLLER_MEASUREMENTS
#define APPLIED (CONTROLLER_MEASUREMENTS + CONTROLLER_PRESSURES)
#define SIGNALS (APPLIED + CONTROLLER_LIMITED)
#define EARLY (1e-6 * CONTROLLER_STEP)

typedef void* fmi2Component;
typedef void* fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer;
typedef int fmi2Boolean;
typedef char fmi2Byte;
typedef const char* fmi2String;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated } fmi2StatusKind;
typedef struct {
  void (*logger)(void*, fmi2String, fmi2Status, fmi2String, fmi2String, ...);
  void* (*allocateMemory)(size_t, size_t);
  void (*freeMemory)(void*);
  void (*stepFinished)(void*, fmi2Status);
  void* componentEnvironment;
} fmi2CallbackFunctions;

typedef struct {
  double memory[CONTROLLER_MEMORY];
  double signals[SIGNALS]; /* measurement, then the pressures, then what was applied of one */
  double start, time;
  long long samples;
  int running, told; /* whether initialisation is over, and an applied pressure was set since */
} State;

typedef struct {
  State state;
  const fmi2CallbackFunctions* callbacks;
  char name[128];
} Unit;

static fmi2Status refuse(const Unit* unit, fmi2String message) {
  if (unit && unit->callbacks && unit->callbacks->logger)
    unit->callbacks->logger(unit->callbacks->componentEnvironment, unit->name, fmi2Error, "logStatusError", "%s", message);
  return fmi2Error;
}

static void begin(Unit* unit) {
  memset(&unit->state, 0, sizeof unit->state);
  controller_reset(unit->state.memory);
}

EXPORTED const char* fmi2GetTypesPlatform(void) { return "default"; }
EXPORTED const char* fmi2GetVersion(void) { return "2.0"; }
EXPORTED fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
  (void)c, (void)on, (void)n, (void)categories;
  return fmi2OK;
}

EXPORTED fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                       const fmi2CallbackFunctions* callbacks, fmi2Boolean visible, fmi2Boolean logging) {
  Unit* unit = calloc(1, sizeof *unit);
  (void)resources, (void)visible, (void)logging;
  if (!unit) return NULL;
  unit->callbacks = callbacks;
  if (name) strncpy(unit->name, name, sizeof unit->name - 1);
  if (type != fmi2CoSimulation || !guid || strcmp(guid, CONTROLLER_GUID)) {
    refuse(unit, type == fmi2CoSimulation ? "the GUID is not that of this controller" : "co-simulation only");
    free(unit);
    return NULL;
  }
  begin(unit);
  return unit;
}

EXPORTED void fmi2FreeInstance(fmi2Component c) { free(c); }

EXPORTED fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerant, fmi2Real tolerance, fmi2Real start,
                                        fmi2Boolean ends, fmi2Real stop) {
  Unit* unit = c;
  (void)tolerant, (void)tolerance, (void)ends, (void)stop;
  if (!isfinite(start)) return refuse(unit, "the start must be a finite time");
  unit->state.start = unit->state.time = start;
  return fmi2OK;
}

EXPORTED fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return c ? fmi2OK : fmi2Error; }
EXPORTED fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
  if (c) ((Unit*)c)->state.running = 1;
  return c ? fmi2OK : fmi2Error;
}
EXPORTED fmi2Status fmi2Terminate(fmi2Component c) { return c ? fmi2OK : fmi2Error; }
EXPORTED fmi2Status fmi2Reset(fmi2Component c) {
  begin(c);
  return fmi2OK;
}

EXPORTED fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Real value[]) {
  Unit* unit = c;
  size_t i;
  for (i = 0; i < n; ++i) {
    if (r[i] >= SIGNALS) return refuse(unit, "no such variable");
    value[i] = unit->state.signals[r[i]];
  }
  return fmi2OK;
}

EXPORTED fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Real value[]) {
  Unit* unit = c;
  size_t i;
  for (i = 0; i < n; ++i) {
    if (r[i] >= SIGNALS || (r[i] >= PRESSURE && r[i] < APPLIED)) return refuse(unit, "only measurement and applied pressure are set");
    unit->state.signals[r[i]] = value[i];
    if (r[i] == APPLIED) unit->state.told = unit->state.running;
  }
  return fmi2OK;
}

EXPORTED fmi2Status fmi2DoStep(fmi2Component c, fmi2Real now, fmi2Real step, fmi2Boolean kept) {
  Unit* unit = c;
  State* state = &unit->state;
  int i;
  (void)kept;
  if (!(step >= 0) || !isfinite(now) || !isfinite(step) || fabs(now - state->time) > EARLY)
    return refuse(unit, "a step must begin where the last one ended, and not go back");
  for (i = 0; i < CONTROLLER_MEASUREMENTS; ++i)
    if (!isfinite(state->signals[i])) return refuse(unit, "the measurement must be finite");
  if (state->told && !isfinite(state->signals[APPLIED])) return refuse(unit, "the applied pressure must be finite");
  for (; state->start + state->samples * CONTROLLER_STEP < now + step - EARLY; ++state->samples)
#if CONTROLLER_LIMITED
    controller_step(state->signals, state->told ? &state->signals[APPLIED] : 0, state->memory, &state->signals[PRESSURE]);
#else
    controller_step(state->signals, state->memory, &state->signals[PRESSURE]);
#endif
  state->time = now + step;
  for (i = PRESSURE; i < APPLIED; ++i)
    if (!isfinite(state->signals[i])) return refuse(unit, "the pressure is not finite");
  return fmi2OK;
}

EXPORTED fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate* kept) {
  if (!*kept && !(*kept = malloc(sizeof(State)))) return refuse(c, "no memory");
  memcpy(*kept, &((Unit*)c)->state, sizeof(State));
  return fmi2OK;
}
EXPORTED fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate kept) {
  memcpy(&((Unit*)c)->state, kept, sizeof(State));
  return fmi2OK;
}
EXPORTED fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate* kept) {
  (void)c;
  free(*kept);
  *kept = NULL;
  return fmi2OK;
}

/* What the standard names and this model has none of. */
#define NONE(name, ...) \
  EXPORTED fmi2Status name(fmi2Component c, __VA_ARGS__) { return refuse(c, "there is none: " #name); }
#define NO_VALUES(kind, type) \
  NONE(fmi2Get##kind, const fmi2ValueReference r[], size_t n, type value[]) \
  NONE(fmi2Set##kind, const fmi2ValueReference r[], size_t n, const type value[])
#define NO_STATUS(kind, type) NONE(fmi2Get##kind##Status, const fmi2StatusKind asked, type* value)

NO_VALUES(Integer, fmi2Integer)
NO_VALUES(Boolean, fmi2Boolean)
NO_VALUES(String, fmi2String)
NONE(fmi2SerializedFMUstateSize, fmi2FMUstate kept, size_t* size)
NONE(fmi2SerializeFMUstate, fmi2FMUstate kept, fmi2Byte bytes[], size_t size)
NONE(fmi2DeSerializeFMUstate, const fmi2Byte bytes[], size_t size, fmi2FMUstate* kept)
NONE(fmi2GetDirectionalDerivative, const fmi2ValueReference of[], size_t n, const fmi2ValueReference by[], size_t m,
     const fmi2Real seed[], fmi2Real value[])
NONE(fmi2SetRealInputDerivatives, const fmi2ValueReference r[], size_t n, const fmi2Integer order[], const fmi2Real v[])
NONE(fmi2GetRealOutputDerivatives, const fmi2ValueReference r[], size_t n, const fmi2Integer order[], fmi2Real v[])
NO_STATUS(, fmi2Status)
NO_STATUS(Integer, fmi2Integer)
NO_STATUS(Boolean, fmi2Boolean)
NO_STATUS(String, fmi2String)
EXPORTED fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind asked, fmi2Real* value) {
  if (asked != fmi2LastSuccessfulTime) return refuse(c, "only the last successful time is available");
  *value = ((Unit*)c)->state.time;
  return fmi2OK;
}
EXPORTED fmi2Status fmi2CancelStep(fmi2Component c) { return refuse(c, "steps are never pending"); }

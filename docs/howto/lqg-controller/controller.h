/*
 * A sampled controller for a fault, in SI units.
 *
 * Call controller_reset once, and controller_step every CONTROLLER_STEP seconds: it reads
 * CONTROLLER_MEASUREMENTS numbers and the pressure [Pa] that was applied since the last call, updates
 * CONTROLLER_MEMORY numbers, and writes the fluid pressure [Pa] to hold until the next call (zero-order hold).
 * Where pump or valve limit the pressure, tell it what was applied: the law does not wind up then, as in
 * simulate --saturation; else give a null pointer. The reference of the fault is computed from the number of
 * calls. The functions keep nothing between calls but the memory they are given, allocate nothing, and may be
 * called from several threads with different memories. Numbers that are not finite are not caught: check
 * measurement and pressure.
 *
 * Compile with: cc -std=c99 -O2 -ffp-contract=off -c controller.c, and link with -lm.
 *
 * measurement[0]: slip [m]
 * measurement[1]: slip_rate [m/s]
 * memory[0]: sample, 0.0 at the start
 * memory[1]: xi_1, 0.0 at the start
 * memory[2]: xi_2, 0.0 at the start
 * memory[3]: xi_3, 0.0 at the start
 * memory[4]: held_0, 0.0 at the start
 * memory[5]: push, 0.0 at the start
 * memory[6]: before_xi_1, 0.0 at the start
 * memory[7]: before_xi_2, 0.0 at the start
 * memory[8]: before_xi_3, 0.0 at the start
 *
 * Where it comes from:
 * fault: real-fault
 * law: states [z1, z2, z3], update [[4064067680102617/10000000000000000, -1935435249868289/50000000000000000,
 * 0], [-2682464237811879/2500000000000000, 2583686218197079/25000000000000000, 0], [-1344300624616817/10000000,
 * -1274102398568909/5000000, 1]], measured [[4026465873544713/10000000000000000,
 * 6033869791673273/50000000000000000], [-2270325626931617/2500000000000000, -797666332625347/5000000000000000],
 * [1344300624616817/10000000, 1274102398568909/5000000]], output [-2990932869139573/50000000,
 * 1360072734255099/5000000, -1], feedback [-25153497198940027/50000000, -4934063769404279/10000000]
 * source: quakedesign.laws.user_law
 * gain k1: 25153497198940027/50000000 Pa/m
 * gain k2: 4934063769404279/10000000 Pa s/m
 * gain z1: 2990932869139573/50000000 Pa
 * gain z2: -1360072734255099/5000000 Pa
 * gain z3: 1 Pa
 * step: 23/125
 * delay: 0
 * lag: 0
 * diffusion: 0
 * longest: 0
 * rest_limit: None
 * label: LQG
 * notes: []
 * scheme: explicit
 * substeps: 1
 * version_quakedesign: 0.4.0
 * version_casadi: 3.8.2
 */
#ifndef CONTROLLER_H
#define CONTROLLER_H

#define CONTROLLER_STEP 0.184 /* s */
#define CONTROLLER_MEASUREMENTS 2
#define CONTROLLER_MEMORY 9
#define CONTROLLER_PRESSURES 1
#define CONTROLLER_LIMITED 1 /* whether applied is an argument */

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

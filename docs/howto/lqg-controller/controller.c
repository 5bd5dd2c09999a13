/* How to prefix internal symbols */
#ifdef CASADI_CODEGEN_PREFIX
  #define CASADI_NAMESPACE_CONCAT(NS, ID) _CASADI_NAMESPACE_CONCAT(NS, ID)
  #define _CASADI_NAMESPACE_CONCAT(NS, ID) NS ## ID
  #define CASADI_PREFIX(ID) CASADI_NAMESPACE_CONCAT(CODEGEN_PREFIX, ID)
#else
  #define CASADI_PREFIX(ID) sampled_step_ ## ID
#endif

#include <math.h>

#ifndef casadi_real
#define casadi_real double
#endif

#ifndef casadi_int
#define casadi_int long long int
#endif

/* Add prefix to internal symbols */
#define casadi_f0 CASADI_PREFIX(f0)
#define casadi_s0 CASADI_PREFIX(s0)
#define casadi_s1 CASADI_PREFIX(s1)
#define casadi_s2 CASADI_PREFIX(s2)
#define casadi_sq CASADI_PREFIX(sq)

casadi_real casadi_sq(casadi_real x) { return x*x;}

#ifndef casadi_inf
  #define casadi_inf INFINITY
#endif

/* Configuration this file was compiled with */
void sampled_step_casadi_version(int* major, int* minor, int* patch) {
  *major = 3;
  *minor = 8;
  *patch = 2;
}
int sampled_step_casadi_int_size(void) { return (int) sizeof(casadi_int); }
int sampled_step_casadi_real_size(void) { return (int) sizeof(casadi_real); }

static const casadi_int casadi_s0[3] = {2, 1, 1};
static const casadi_int casadi_s1[3] = {1, 1, 1};
static const casadi_int casadi_s2[3] = {9, 1, 1};

/* sampled_step:(i0[2],i1,i2[9])->(o0[9],o1) */
static int casadi_f0(const casadi_real** arg, casadi_real** res, casadi_int* iw, casadi_real* w, int mem) {
  casadi_real a00, a01, a02, a03, a04, a05, a06, a07, a08, a09, a10, a11;
  casadi_real a12;
  a00=arg[2]? arg[2][0] : 0;
  a01=1.;
  a01=(a00+a01);
  if (res[0]!=0) res[0][0]=a01;
  a01=0.;
  a02=arg[2]? arg[2][4] : 0;
  a03=arg[1]? arg[1][0] : 0;
  a02=(a02-a03);
  a03=arg[2]? arg[2][5] : 0;
  a02=(a02*a03);
  a01=(a01<a02);
  a02=arg[2]? arg[2][6] : 0;
  a02=(a01?a02:0);
  a03=(!a01);
  a04=arg[2]? arg[2][1] : 0;
  a04=(a03?a04:0);
  a02=(a02+a04);
  a04=1.8400000000000000e-01;
  a05=6.5585541213839926e-01;
  a06=arg[0]? arg[0][1] : 0;
  a00=(a04*a00);
  a07=663012.;
  a08=(a00<a07);
  a09=1.8381627760828963e-28;
  a10=casadi_sq(a00);
  a09=(a09*a10);
  a10=-663012.;
  a10=(a10+a00);
  a10=casadi_sq(a10);
  a09=(a09*a10);
  a08=(a08?a09:0);
  a06=(a06-a08);
  a05=(a05*a06);
  a08=2.1882966704047355e+00;
  a09=arg[0]? arg[0][0] : 0;
  a10=2.6934287414359035e-18;
  a11=(a07<a00);
  a12=casadi_inf;
  a12=(a00<=a12);
  a12=(!a12);
  a11=(a11||a12);
  a07=(a11?a07:0);
  a11=(!a11);
  a11=(a11?a00:0);
  a07=(a07+a11);
  a11=casadi_sq(a07);
  a00=(a11*a07);
  a10=(a10*a00);
  a00=10.;
  a12=-2.2624024904526614e-05;
  a12=(a12*a07);
  a00=(a00+a12);
  a12=1.3649240076817081e-11;
  a12=(a12*a11);
  a00=(a00+a12);
  a10=(a10*a00);
  a09=(a09-a10);
  a08=(a08*a09);
  a05=(a05+a08);
  a08=3.2260501738572733e+00;
  a08=(a08*a02);
  a05=(a05-a08);
  a08=2.1037339672481403e-01;
  a10=arg[2]? arg[2][7] : 0;
  a10=(a01?a10:0);
  a00=arg[2]? arg[2][2] : 0;
  a00=(a03?a00:0);
  a10=(a10+a00);
  a08=(a08*a10);
  a05=(a05-a08);
  a08=(a04*a05);
  a08=(a02+a08);
  if (res[0]!=0) res[0][1]=a08;
  a08=8.6702862241885548e-01;
  a08=(a08*a06);
  a00=4.9354904933296018e+00;
  a00=(a00*a09);
  a08=(a08+a00);
  a00=5.8314439952432151e+00;
  a00=(a00*a02);
  a08=(a08+a00);
  a00=4.8731116916962876e+00;
  a00=(a00*a10);
  a08=(a08+a00);
  a08=(a04*a08);
  a08=(a10-a08);
  if (res[0]!=0) res[0][2]=a08;
  a00=arg[2]? arg[2][8] : 0;
  a01=(a01?a00:0);
  a00=arg[2]? arg[2][3] : 0;
  a03=(a03?a00:0);
  a01=(a01+a03);
  a03=1.3848939114879446e+09;
  a00=(a03*a06);
  a12=7.3059816555261791e+08;
  a11=(a12*a09);
  a00=(a00+a11);
  a12=(a12*a02);
  a00=(a00-a12);
  a03=(a03*a10);
  a00=(a00-a03);
  a04=(a04*a00);
  a00=(a01+a04);
  if (res[0]!=0) res[0][3]=a00;
  a00=2.7201454685101980e+08;
  a03=(a00*a10);
  a03=(a03-a01);
  a12=4.9340637694042790e+08;
  a12=(a12*a06);
  a03=(a03-a12);
  a12=5.0306994397880054e+08;
  a12=(a12*a09);
  a03=(a03-a12);
  a12=5.9818657382791460e+07;
  a12=(a12*a02);
  a03=(a03-a12);
  if (res[0]!=0) res[0][4]=a03;
  a08=(a08-a10);
  a00=(a00*a08);
  a08=1.1006632958433628e+07;
  a08=(a08*a05);
  a00=(a00-a08);
  a00=(a00-a04);
  if (res[0]!=0) res[0][5]=a00;
  if (res[0]!=0) res[0][6]=a02;
  if (res[0]!=0) res[0][7]=a10;
  if (res[0]!=0) res[0][8]=a01;
  if (res[1]!=0) res[1][0]=a03;
  return 0;
}

int sampled_step(const casadi_real** arg, casadi_real** res, casadi_int* iw, casadi_real* w, int mem){
  return casadi_f0(arg, res, iw, w, mem);
}

int sampled_step_checkout(void) {
  return 0;
}

void sampled_step_release(int mem) {
}

void sampled_step_incref(void) {
}

void sampled_step_decref(void) {
}

casadi_int sampled_step_n_in(void) { return 3;}

casadi_int sampled_step_n_out(void) { return 2;}

casadi_real sampled_step_default_in(casadi_int i) {
  switch (i) {
    default: return 0;
  }
}

const char* sampled_step_name_in(casadi_int i) {
  switch (i) {
    case 0: return "i0";
    case 1: return "i1";
    case 2: return "i2";
    default: return 0;
  }
}

const char* sampled_step_name_out(casadi_int i) {
  switch (i) {
    case 0: return "o0";
    case 1: return "o1";
    default: return 0;
  }
}

const casadi_int* sampled_step_sparsity_in(casadi_int i) {
  switch (i) {
    case 0: return casadi_s0;
    case 1: return casadi_s1;
    case 2: return casadi_s2;
    default: return 0;
  }
}

const casadi_int* sampled_step_sparsity_out(casadi_int i) {
  switch (i) {
    case 0: return casadi_s2;
    case 1: return casadi_s1;
    default: return 0;
  }
}

int sampled_step_work(casadi_int *sz_arg, casadi_int* sz_res, casadi_int *sz_iw, casadi_int *sz_w) {
  if (sz_arg) *sz_arg = 3;
  if (sz_res) *sz_res = 2;
  if (sz_iw) *sz_iw = 0;
  if (sz_w) *sz_w = 0;
  return 0;
}

int sampled_step_work_bytes(casadi_int *sz_arg, casadi_int* sz_res, casadi_int *sz_iw, casadi_int *sz_w) {
  if (sz_arg) *sz_arg = 3*sizeof(const casadi_real*);
  if (sz_res) *sz_res = 2*sizeof(casadi_real*);
  if (sz_iw) *sz_iw = 0*sizeof(casadi_int);
  if (sz_w) *sz_w = 0*sizeof(casadi_real);
  return 0;
}



#include "controller.h"

void controller_reset(double* memory) {
  static const double start[CONTROLLER_MEMORY] = {
    0.0,
    0.0,
    0.0,
    0.0,
    0.0,
    0.0,
    0.0,
    0.0,
    0.0
  };
  int i;
  for (i = 0; i < CONTROLLER_MEMORY; ++i) memory[i] = start[i];
}

void controller_step(const double* measurement, const double* applied, double* memory, double* pressure) {
  const double* arguments[3] = {measurement, applied ? applied : &memory[4], memory};
  double after[CONTROLLER_MEMORY];
  double* results[2] = {after, pressure};
  casadi_int integers[1];
  double work[13];
  int i;
  sampled_step(arguments, results, integers, work, 0);
  for (i = 0; i < CONTROLLER_MEMORY; ++i) memory[i] = after[i];
}

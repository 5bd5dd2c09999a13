
/* Every lane moves on until the steps are taken; what a sample is when it diverges is put aside. */
static void advance_lanes(double z[${size}][LANES], double kept[${size}][LANES], int* ended, long long steps) {
  long long taken;
  int lane, i, left = 0;
  for (lane = 0; lane < LANES; ++lane) left += !ended[lane];
  for (taken = 0; taken < steps && left; ++taken) {
    int more = 0;
    one_step(z);
    for (lane = 0; lane < LANES; ++lane) more |= z[${diverged}][lane] >= 0;
    if (more)
      for (lane = 0; lane < LANES; ++lane)
        if (!ended[lane] && z[${diverged}][lane] >= 0) {
          for (i = 0; i < ${size}; ++i) kept[i][lane] = z[i][lane];
          ended[lane] = 1;
          --left;
        }
  }
  for (lane = 0; lane < LANES; ++lane)
    if (!ended[lane])
      for (i = 0; i < ${size}; ++i) kept[i][lane] = z[i][lane];
}

/* Whether this processor has the instructions that the compiler was allowed to use. */
EXPORTED int made_for_this_processor(void) {
#if defined(__AVX512F__)
  return __builtin_cpu_supports("avx512f") != 0;
#elif defined(__AVX2__)
  return __builtin_cpu_supports("avx2") != 0;
#else
  return 1;
#endif
}

EXPORTED int advance_samples(double* vectors, long long samples, long long steps) {
  static const int size = ${size};
  double z[${size}][LANES], kept[${size}][LANES];
  double* rows[LANES];
  int ended[LANES];
  long long sample = 0;
  while (sample < samples) {
    int lane, i, used = 0;
    for (; used < LANES && sample < samples; ++sample) {
      double* row = vectors + sample * size;
      if (!(row[${diverged}] >= 0)) rows[used++] = row;
    }
    if (!used) break;
    for (lane = 0; lane < LANES; ++lane) {
      ended[lane] = lane >= used;
      for (i = 0; i < size; ++i) z[i][lane] = rows[lane < used ? lane : 0][i];
    }
    advance_lanes(z, kept, ended, steps);
    for (lane = 0; lane < used; ++lane)
      for (i = 0; i < size; ++i) rows[lane][i] = kept[i][lane];
  }
  return 0;
}

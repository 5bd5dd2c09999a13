#include <math.h>
#include <string.h>

#if defined(__GNUC__)
#define PORTABLE static inline __attribute__((always_inline))
#else
#define PORTABLE static inline
#endif
#if defined(_WIN32)
#define EXPORTED __declspec(dllexport)
#elif defined(__GNUC__)
#define EXPORTED __attribute__((visibility("default")))
#else
#define EXPORTED
#endif

/* The bits of a float hold its exponent, moved by 1023, before the 52 of its fraction. */
PORTABLE double two_to(double exponent) {
  double shifted = exponent + 4503599627371519.0;
  unsigned long long bits;
  memcpy(&bits, &shifted, 8);
  bits <<= 52;
  memcpy(&shifted, &bits, 8);
  return shifted;
}

/* n of x = m 2^n with m from the root of 1/2, whose bits are subtracted, to that of 2. */
PORTABLE double exponent_of(double x) {
  unsigned long long bits;
  memcpy(&bits, &x, 8);
  bits = ((bits + 0x00095F619980C433ULL) >> 52) | 0x4330000000000000ULL;
  memcpy(&x, &bits, 8);
  return x - 4503599627371519.0;
}

/* m of the same. */
PORTABLE double mantissa_of(double x) {
  unsigned long long bits;
  memcpy(&bits, &x, 8);
  bits -= ((bits + 0x00095F619980C433ULL) & 0xFFF0000000000000ULL) - 0x3FF0000000000000ULL;
  memcpy(&x, &bits, 8);
  return x;
}

/* A third of the leading bits of x, 16 of its fraction among them, as those of a float; rounded downwards. */
PORTABLE double near_cube_root(double x) {
  unsigned long long bits;
  memcpy(&bits, &x, 8);
  bits = (bits >> 36) | 0x4330000000000000ULL;
  memcpy(&x, &bits, 8);
  x = (x - 4503599627370497.0) * (1 / 3.0) + 4503599672063760.0;
  memcpy(&bits, &x, 8);
  bits <<= 36;
  memcpy(&x, &bits, 8);
  return x;
}

// SPDX-License-Identifier: Apache-2.0
// Vectors of neighbours, for every kernel.
//
// Define: WIDTH, the neighbours in x that one work-item handles together: 1 for a GPU, 4 or 8 for a
// CPU, whose vector registers then fill without any help from the compiler.

#if !defined(WIDTH) || (WIDTH != 1 && WIDTH != 4 && WIDTH != 8)
#error "WIDTH, the neighbours per work-item, must be 1, 4 or 8"
#endif

#define INLINE inline __attribute__((always_inline))

// Not the built-in min, clamp, select, vload and so on in inner loops: PoCL calls a function for
// each of those, and nothing stays in registers across a call.
#define MIN(a, b) ((a) < (b) ? (a) : (b))
#define MAX(a, b) ((a) > (b) ? (a) : (b))
#define CLAMP(i, low, high) ((i) < (low) ? (low) : (i) > (high) ? (high) : (i))

// A `real` is a vector of WIDTH neighbours. LANES(type, f) builds one from f(0), f(1), ...;
// LANE(v, n) is lane n, a constant, of one.
#if WIDTH == 1
typedef float real;
typedef int mask;
typedef uint bits;
#define LANES(type, f) f(0)
#define LANE(v, n) (v)
#define AS_BITS as_uint
#define AS_REAL as_float
INLINE float lane_sum(real v) { return v; }
#elif WIDTH == 4
typedef float4 real;
typedef int4 mask;
typedef uint4 bits;
#define LANES(type, f) ((type)(f(0), f(1), f(2), f(3)))
#define LANE(v, n) ((n) == 0 ? (v).s0 : (n) == 1 ? (v).s1 : (n) == 2 ? (v).s2 : (v).s3)
#define AS_BITS as_uint4
#define AS_REAL as_float4
INLINE float half_sum(float2 v) { return v.x + v.y; }
INLINE float lane_sum(real v) { return half_sum(v.lo + v.hi); }
#else
typedef float8 real;
typedef int8 mask;
typedef uint8 bits;
#define LANES(type, f) ((type)(f(0), f(1), f(2), f(3), f(4), f(5), f(6), f(7)))
#define LANE(v, n)                                                                              \
    ((n) == 0 ? (v).s0 : (n) == 1 ? (v).s1 : (n) == 2 ? (v).s2 : (n) == 3 ? (v).s3 : (n) == 4 ? \
     (v).s4 : (n) == 5 ? (v).s5 : (n) == 6 ? (v).s6 : (v).s7)
#define AS_BITS as_uint8
#define AS_REAL as_float8
INLINE float half_sum(float4 v)
{
    const float2 pair = v.lo + v.hi;
    return pair.x + pair.y;
}
INLINE float lane_sum(real v) { return half_sum(v.lo + v.hi); }
// The sums of the lower and the upper halves of four vectors: a, b, c, d below and again above.
#define ADJACENT(a, b)                                                                     \
    ((real)((a).s02, (b).s02, (a).s46, (b).s46) + (real)((a).s13, (b).s13, (a).s57, (b).s57))
INLINE real half_sums(real a, real b, real c, real d)
{
    const real ab = ADJACENT(a, b), cd = ADJACENT(c, d);
    return ADJACENT(ab, cd);
}
typedef float2 unaligned_pair __attribute__((aligned(4)));
#endif

#define LANE_NUMBER(i) (i)

// WIDTH neighbouring floats, at any address.
typedef real unaligned_real __attribute__((aligned(4)));
#define READ(p) (*(global const unaligned_real *)(p))
#define WRITE(v, p) (*(global unaligned_real *)(p) = (v))
typedef float4 unaligned_float4 __attribute__((aligned(4)));
#define READ_4(p) (*(global const unaligned_float4 *)(p))

// e^x for x <= 0, to 3e-7 of itself; 0 from -87 on. Inline, unlike the built-in function.
INLINE real exp_below_0(real x)
{
    const real bits_of_e = 1.44269504f * MAX(x, -87.3f), shifted = bits_of_e + 12582912.0f;
    const real t = bits_of_e - (shifted - 12582912.0f);  // within a half of 0
    real power = 1.53981e-4f;
    power = power * t + 1.339887440e-3f;
    power = power * t + 9.618437357e-3f;
    power = power * t + 5.550332548e-2f;
    power = power * t + 2.402264791e-1f;
    power = power * t + 6.931472028e-1f;
    power = power * t + 1;
    return x < -87.3f ? (real)0 : power * AS_REAL((AS_BITS(shifted) << 23) + 0x3f800000u);
}

// The natural logarithm of x > 0, to 2e-7 or that of itself (the polynomial is that of Cephes).
INLINE real log_above_0(real x)
{
    // x = 2^e (1 + t), with 1 + t between the roots of 1/2 and of 2.
    const bits moved = AS_BITS(x) + (0x3f800000u - 0x3f3504f3u);
    const real e = AS_REAL((moved >> 23) | 0x4b000000u) - (8388608.0f + 127.0f);
    const real t = AS_REAL((moved & 0x7fffffu) + 0x3f3504f3u) - 1, square = t * t;
    real sum = 7.0376836292e-2f;
    sum = sum * t - 1.1514610310e-1f;
    sum = sum * t + 1.1676998740e-1f;
    sum = sum * t - 1.2420140846e-1f;
    sum = sum * t + 1.4249322787e-1f;
    sum = sum * t - 1.6668057665e-1f;
    sum = sum * t + 2.0000714765e-1f;
    sum = sum * t - 2.4999993993e-1f;
    sum = sum * t + 3.3333331174e-1f;
    return t + (t * square * sum - 0.5f * square + 0.69314718f * e);
}

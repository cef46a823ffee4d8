// SPDX-License-Identifier: Apache-2.0
// From pixels to products: what moments.cl and weighted_moments.cl do with WIDTH pixels of a row.
// Comes after images.h.
//
// Defines: BLOCK, side of a block in pixels; WEIGHTED, if there is an image of weights, and MASKED, if
// it holds booleans; LIGHT, if the target is an image of that many channels of which only the
// brightness counts (C is 1 then).

#if !defined(BLOCK) || BLOCK < 1
#error "BLOCK, the side of a block in pixels, must be at least 1"
#endif

#ifdef MASKED
typedef uchar weight_t;
#define WEIGHT_AT(i) (weight[pixel + MIN(i, last)] ? 1.0f : 0.0f)
#else
typedef float weight_t;
#define WEIGHT_AT(i) weight[pixel + MIN(i, last)]
#endif
#define INSIDE(i) ((i) <= last ? 1.0f : 0.0f)

#ifdef LIGHT
#define TARGETS LIGHT
#else
#define TARGETS C
#endif

// Guides and target of the pixels pixel to pixel + last; the other lanes repeat the last of them.
INLINE void read_pixels(
    global const target_t *target, GUIDE_PARAMETERS, long pixel, int last, real *x, real *y)
{
    if (last == WIDTH - 1) {
        EXPECT(target, (pixel + AHEAD) * TARGETS);
        EXPECT(guides_0, (pixel + AHEAD) * PART_0);
        EXPECT(guides_1, (pixel + AHEAD) * PART_1);
        EXPECT(guides_2, (pixel + AHEAD) * PART_2);
    }
#pragma unroll
    for (int q = 0; q < Q; ++q) x[q] = read_guide(GUIDE_IMAGES, q, pixel, 0, last);
#ifdef LIGHT
    y[0] = 0;
#endif
#pragma unroll
    for (int c = 0; c < TARGETS; ++c) {
        const real lanes = target_lanes(target + pixel * TARGETS, TARGETS, c, 0, last);
#ifdef LIGHT
        y[0] += BRIGHTNESS(c) * lanes;
#else
        y[c] = lanes;
#endif
    }
}

// How much each pixel counts by itself: 0 outside the frame, where a value is not finite and where
// its weight is not above 0.
INLINE real usable(
    global const weight_t *weight, long pixel, int last, const real *x, const real *y)
{
    real counts = last == WIDTH - 1 ? (real)1 : LANES(real, INSIDE);
    real zero = 0;  // stays 0 unless a value is not finite: 0 Inf and 0 NaN are NaN
#pragma unroll
    for (int q = 0; q < Q; ++q) zero += 0 * x[q];
#pragma unroll
    for (int c = 0; c < C; ++c) zero += 0 * y[c];
#ifdef WEIGHTED
    const real w = LANES(real, WEIGHT_AT);
    zero += 0 * w;
    counts = w > 0 ? w * counts : (real)0;
#endif
    return zero == 0 ? counts : (real)0;
}

// Reads pixels as both do: x less the shift, and how much each counts; where it does not, x and y are 0.
INLINE real read_usable(
    global const target_t *target, GUIDE_PARAMETERS, global const weight_t *weight,
    constant float *shift, long pixel, int last, real *x, real *y)
{
    if (last == WIDTH - 1)
        read_pixels(target, GUIDE_IMAGES, pixel, WIDTH - 1, x, y);
    else
        read_pixels(target, GUIDE_IMAGES, pixel, last, x, y);
    const real one = usable(weight, pixel, last, x, y);
#pragma unroll
    for (int q = 0; q < Q; ++q) x[q] = one > 0 ? from_shift(x[q], shift[q]) : (real)0;
#pragma unroll
    for (int c = 0; c < C; ++c) y[c] = one > 0 ? y[c] : (real)0;
    return one;
}

// Adds the products of [1, X, Y], times `one`, to the K sums. x and y are 0 where `one` is, and where
// that is all it can be besides 1 it need not be multiplied in: FRACTIONS, if it can be more.
INLINE void add_products(real *sums, real one, const real *x, const real *y)
{
#if defined(WEIGHTED) || defined(FRACTIONS)
#define WEIGHTED_BY_ONE(v) (one * (v))
#else
#define WEIGHTED_BY_ONE(v) (v)
#endif
    sums[0] += one;
#pragma unroll
    for (int c = 0; c < C; ++c) sums[XY(0, c)] += WEIGHTED_BY_ONE(y[c]);
#pragma unroll
    for (int i = 0; i < Q; ++i) {
        const real u = WEIGHTED_BY_ONE(x[i]);
        sums[XX(i + 1, 0)] += u;
#pragma unroll
        for (int j = 0; j <= i; ++j) sums[XX(i + 1, j + 1)] += u * x[j];
#pragma unroll
        for (int c = 0; c < C; ++c) sums[XY(i + 1, c)] += u * y[c];
    }
}

// One level of adaptive FLR: the second pass of the window, along columns, and the models under it.
//
// Defines beside those of the headers: ROUNDING, roundings of a sum of squares that may add up;
// DOWN, 1 if neighbouring work-items are below each other: on a processor, what one has read is then
// still in the cache for the next.

#include "vectors.h"
#include "sizes.h"
#include "grids.h"
#include "window.h"
#include "rows.h"
#include "models.h"
#define G (Q + 2 * POSITIONS)
#include "least_squares.h"

// Eight sums at a time stay in registers while the taps go by.
#define TOGETHER 8

// sums: of the first `count` planes, no more than TOGETHER, over the column. rows: plane 0 at the block.
// moved: how far away each tap's row lies.
INLINE void along_column(
    global const float *rows, const long *moved, const real *weights, int count, real *sums)
{
    real total[TOGETHER];
#pragma unroll
    for (int k = 0; k < TOGETHER; ++k) total[k] = 0;
#pragma unroll
    for (int t = 0; t < TAPS; ++t) {
#pragma unroll
        for (int k = 0; k < TOGETHER; ++k)
            if (k < count) total[k] += weights[t] * READ(rows + moved[t] + k * GROUP);
    }
#pragma unroll
    for (int k = 0; k < TOGETHER; ++k)
        if (k < count) sums[k] = total[k];
}

// The pass along columns, then least squares with a ridge that grows with the noise: the variance of
// the window's mean brightness, sum(w^2 r^2) / sum(w)^2, relative to the squared brightness.
//
// side: of a block in pixels. rows: from window_rows. models: see models.h.
// Global size (pitch / WIDTH, h), or the other way round if DOWN.
kernel void fit(
    int h, int pitch, int side, float sigma, float eps, float eps_prime, float noise_ridge,
    float position_ridge, global const float *mean, constant float *shift,
    global const float *features, global const float *rows, global float *models)
{
    const int x = (int)get_global_id(DOWN ? 1 : 0) * WIDTH, y = get_global_id(DOWN ? 0 : 1);
    if (x >= pitch || y >= h) return;
    rows += AT(x, y, pitch, ROWS);
    int to_row[TAPS];
    long moved[TAPS];
    real weights[TAPS], more[TAPS];
    column_weights(features, x, y, h, pitch, sigma, to_row, weights);
#pragma unroll
    for (int t = 0; t < TAPS; ++t) moved[t] = (long)to_row[t] * pitch * ROWS;

    real sums[ROWS], xx[XX(G, G) + 1], xy[(G + 1) * C], shifts[G + 1], variance = 0;
#pragma unroll
    for (int k = 0; k < ROWS; k += TOGETHER)
        along_column(rows + k * GROUP, moved, weights, ROWS - k, sums + k);
#if NOISE
#pragma unroll
    for (int t = 0; t < TAPS; ++t) more[t] = weights[t] * weights[t];
    along_column(rows + K * GROUP, moved, more, 1, &variance);
#endif
    UNROLL
    for (int k = 0; k < XY(0, 0); ++k) xx[k] = sums[k];
    UNROLL
    for (int k = 0; k < (Q + 1) * C; ++k) xy[k] = sums[XY(0, 0) + k];
    UNROLL
    for (int q = 0; q < Q; ++q) shifts[q] = shift[q];
#if POSITIONS
    const float per_sigma = 1 / sigma;
#pragma unroll
    for (int t = 0; t < TAPS; ++t) more[t] = weights[t] * ((t - REACH) * per_sigma);
    UNROLL
    for (int i = 0; i <= Q; ++i) along_column(rows + XX(i, 0) * GROUP, moved, more, 1, xx + XX(Q + 2, i));
    along_column(rows + ROW_X(0) * GROUP, moved, more, 1, xx + XX(Q + 2, Q + 1));
    UNROLL
    for (int c = 0; c < C; ++c)
        along_column(rows + XY(0, c) * GROUP, moved, more, 1, xy + (Q + 2) * C + c);
#pragma unroll
    for (int t = 0; t < TAPS; ++t) more[t] *= (t - REACH) * per_sigma;
    along_column(rows, moved, more, 1, xx + XX(Q + 2, Q + 2));
    UNROLL
    for (int i = 0; i <= Q; ++i) xx[XX(Q + 1, i)] = sums[ROW_X(i)];
    xx[XX(Q + 1, Q + 1)] = sums[ROW_XX];
    UNROLL
    for (int c = 0; c < C; ++c) xy[(Q + 1) * C + c] = sums[ROW_X(Q + 1 + c)];
    // Positions are centred on the window already, so only their own ridge is added.
    xx[XX(Q + 1, Q + 1)] += position_ridge * xx[0];
    xx[XX(Q + 2, Q + 2)] += position_ridge * xx[0];
    shifts[Q] = shifts[Q + 1] = 0;
#endif

    const real n = MAX(xx[0], 1e-12f) * side, per_pixel = xx[0] > 1e-12f ? 1 / xx[0] : (real)0;
    UNROLL
    for (int k = 0; k <= XX(G, G); ++k) xx[k] *= per_pixel;
    UNROLL
    for (int k = 0; k < (G + 1) * C; ++k) xy[k] *= per_pixel;
    variance = variance / (n * n);
    real luminance = 0;
#pragma unroll
    for (int c = 0; c < C; ++c) luminance += BRIGHTNESS(c) * xy[c];
    luminance = MAX(luminance, 0);
    real ridge = noise_ridge * variance / (luminance * luminance + 0.01f * mean[0] * mean[0]);
    ridge = MIN(ridge, 1);

    real coefficients[(G + 1) * C], zero = 0;  // stays 0 unless a coefficient is not finite
    least_squares(
        xx, xy, shifts, eps + ridge, eps_prime + ridge, ROUNDING * FLT_EPSILON, coefficients);
#pragma unroll
    for (int i = 0; i < (Q + 1) * C; ++i) zero += 0 * coefficients[i];
    models += AT(x, y, pitch, MODELS);
#pragma unroll
    for (int q = 0; q <= Q; ++q) {
        real brightness = 0;
#pragma unroll
        for (int c = 0; c < C; ++c) {
            const real value = zero == 0 ? coefficients[q * C + c] : (real)0;
            WRITE(value, models + (q * C + c) * GROUP);
            brightness += BRIGHTNESS(c) * value;
        }
        WRITE(brightness, models + LIGHT_PLANE(q) * GROUP);
    }
    WRITE(variance, models + VARIANCE * GROUP);
}

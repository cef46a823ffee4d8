// SPDX-License-Identifier: Apache-2.0
// One level of adaptive FLR: what must be alike in a window, the edge-aware window in two passes, along
// rows and along columns, and the models under it. The models' numbers of guides and channels are
// constants; that there is a coarser grid is told when the kernels run, as `refines` (window.h), and
// which tiles of the finest grid are wanted, as `tiles` (grids.h).
//
// Defines beside those of the headers: NOISE, 1 if a plane of noise lies behind the moments; POSITIONS, 1
// if the position in the window is two more guides; ROUNDING, roundings of a sum of squares that may
// add up; DOWN, 1 if neighbouring work-items of `fit` are below each other: on a processor, what one has
// read is then still in the cache for the next.

#include "vectors.h"
#include "sizes.h"
#include "grids.h"
#include "window.h"
#include "models.h"
#define G (Q + 2 * POSITIONS)
#include "least_squares.h"

// What the pass along rows leaves for the pass along columns: ROWS planes, as in grids.h.
#define ROW_X(i) (K + NOISE + (i))
#define ROW_XX ROW_X(Q + 1 + C)
#define ROWS (K + NOISE + POSITIONS * (Q + C + 2))

// features: the mean guides of each block, times guide_scale. And, if `refines`, brightness_scale
// log(luminance / mean + 0.1) with the luminance that the coarser grids found, and that level.
//
// moments: (h, pitch / GROUP, K + NOISE, GROUP). found: models of the next coarser grid.
// Global size (pitch / WIDTH, h).
kernel void features(
    int h, int pitch, int refines, int coarse_h, int coarse_w, int coarse_pitch, float guide_scale,
    float brightness_scale, global const uchar *tiles, global const float *mean,
    global const float *moments, global const float *found, global float *features)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= pitch || y >= h || !refined(tiles, h, pitch, x, y, 1, 1)) return;
    moments += AT(x, y, pitch, K + NOISE);
    features += AT(x, y, pitch, FEATURE_PLANES);
    for (int q = 0; q <= Q; ++q) EXPECT_BLOCK(moments + XX(q, 0) * GROUP, K + NOISE);
    const real n = READ(moments);
    const real per_pixel = n > 1e-12f ? 1 / n : (real)0;
#define GUIDE(q) (READ(moments + XX((q) + 1, 0) * GROUP) * per_pixel)
    for (int q = 0; q < Q; ++q) WRITE(guide_scale * GUIDE(q), features + q * GROUP);
    if (!refines) return;
    const coarse_t coarse = coarse_at(found, MODELS, coarse_h, coarse_w, coarse_pitch, x, y);
    real luminance = doubled(&coarse, LIGHT_PLANE(0));
    for (int q = 0; q < Q; ++q) luminance += GUIDE(q) * doubled(&coarse, LIGHT_PLANE(q + 1));
    luminance = MAX(luminance, 0);
    WRITE(brightness_scale * log(luminance / mean[0] + 0.1f), features + Q * GROUP);
    WRITE(luminance, features + (Q + 1) * GROUP);
}

INLINE real along_row(global const float *p, int x, int pitch, const real *weights)
{
    real sum = 0;
    FOR_TAPS(p, K + NOISE, ADD_WEIGHTED)
    return sum;
}

// The window along the rows.
//
//   m[k] = sum_t w_t plane[k](x + t)                      k = 0 .. K - 1
//   noise = sum_t w_t^2 plane[K](x + t)                   if NOISE
//   m_x[k] = sum_t w_t (t / sigma) plane(x + t)           the Q + 1 + C moments with 1
//   m_xx = sum_t w_t (t / sigma)^2 plane[0](x + t)        the last two if POSITIONS
//
// A product with the position of block centres is a pass whose weights are multiplied by it.
//
// moments: (h, pitch / GROUP, K + NOISE, GROUP). Global size (pitch / WIDTH, h).
kernel void window_rows(
    int h, int pitch, int refines, float sigma, global const uchar *tiles,
    global const float *features, global const float *moments, global float *rows)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= pitch || y >= h || !refined(tiles, h, pitch, x, y, 0, 1)) return;
    moments += AT(x, y, pitch, K + NOISE);
    rows += AT(x, y, pitch, ROWS);
    real weights[TAPS], more[TAPS];
    row_weights(features, refines, x, y, pitch, sigma, weights);
#define ALONG(k, weights) along_row(moments + (k) * GROUP, x, pitch, weights)
    for (int k = 0; k < K; ++k) WRITE(ALONG(k, weights), rows + k * GROUP);
#if NOISE
#pragma unroll
    for (int t = 0; t < TAPS; ++t) more[t] = weights[t] * weights[t];
    WRITE(ALONG(K, more), rows + K * GROUP);
#endif
#if POSITIONS
    const float per_sigma = 1 / sigma;
#pragma unroll
    for (int t = 0; t < TAPS; ++t) more[t] = weights[t] * ((t - REACH) * per_sigma);
    for (int i = 0; i <= Q; ++i) WRITE(ALONG(XX(i, 0), more), rows + ROW_X(i) * GROUP);
    for (int c = 0; c < C; ++c) WRITE(ALONG(XY(0, c), more), rows + ROW_X(Q + 1 + c) * GROUP);
#pragma unroll
    for (int t = 0; t < TAPS; ++t) more[t] *= (t - REACH) * per_sigma;
    WRITE(ALONG(0, more), rows + ROW_XX * GROUP);
#endif
}

// A loop of which the compiler is to make no copies: they took it a minute.
#define ROLLED _Pragma("unroll 1")

// Adds `count` planes, a constant, of a row times its weight to the sums.
INLINE void add_row(global const float *row, real weight, int count, real *sums)
{
    _Pragma("unroll 4")
    for (int k = 0; k < count; ++k) sums[k] += weight * READ(row + k * GROUP);
}

// The pass along columns, then least squares with a ridge that grows with the noise: the variance of
// the window's mean brightness, sum(w^2 r^2) / sum(w)^2, relative to the squared brightness.
//
// side: of a block in pixels. rows: from window_rows. models: see models.h.
// Global size (pitch / WIDTH, h), or the other way round if DOWN.
kernel void fit(
    int h, int pitch, int refines, int side, float sigma, float eps, float eps_prime,
    float noise_ridge, float position_ridge, global const uchar *tiles, global const float *mean,
    constant float *shift, global const float *features, global const float *rows, global float *models)
{
    const int x = (int)get_global_id(DOWN ? 1 : 0) * WIDTH, y = get_global_id(DOWN ? 0 : 1);
    if (x >= pitch || y >= h || !refined(tiles, h, pitch, x, y, 0, 0)) return;
    rows += AT(x, y, pitch, ROWS);
    int to_row[TAPS];
    real weights[TAPS];
    column_weights(features, refines, x, y, h, pitch, sigma, to_row, weights);

    real sums_xx[XX(G, G) + 1], sums_xy[(G + 1) * C], shifts[G + 1], variance = 0;
    for (int k = 0; k <= XX(G, G); ++k) sums_xx[k] = 0;
    for (int k = 0; k < (G + 1) * C; ++k) sums_xy[k] = 0;
    UNROLL
    for (int q = 0; q < Q; ++q) shifts[q] = shift[q];
    // Each row of blocks is read once, from its first plane to its last.
    ROLLED
    for (int t = 0; t < TAPS; ++t) {
        global const float *row = rows + (long)to_row[t] * pitch * ROWS;
        const real weight = weights[t];
        add_row(row, weight, XY(0, 0), sums_xx);
        add_row(row + XY(0, 0) * GROUP, weight, (Q + 1) * C, sums_xy);
#if NOISE
        variance += weight * weight * READ(row + K * GROUP);
#endif
#if POSITIONS
        const real below = weight * ((t - REACH) / sigma);
        add_row(row + ROW_X(0) * GROUP, weight, Q + 1, sums_xx + XX(Q + 1, 0));
        add_row(row + ROW_XX * GROUP, weight, 1, sums_xx + XX(Q + 1, Q + 1));
        add_row(row + ROW_X(Q + 1) * GROUP, weight, C, sums_xy + (Q + 1) * C);
        for (int i = 0; i <= Q; ++i) sums_xx[XX(Q + 2, i)] += below * READ(row + XX(i, 0) * GROUP);
        add_row(row + ROW_X(0) * GROUP, below, 1, sums_xx + XX(Q + 2, Q + 1));
        add_row(row + XY(0, 0) * GROUP, below, C, sums_xy + (Q + 2) * C);
        add_row(row, below * ((t - REACH) / sigma), 1, sums_xx + XX(Q + 2, Q + 2));
#endif
    }
#if POSITIONS
    // Positions are centred on the window already, so only their own ridge is added.
    sums_xx[XX(Q + 1, Q + 1)] += position_ridge * sums_xx[0];
    sums_xx[XX(Q + 2, Q + 2)] += position_ridge * sums_xx[0];
    shifts[Q] = shifts[Q + 1] = 0;
#endif
    const real count = sums_xx[0], n = MAX(count, 1e-12f) * side;
    const real per_pixel = count > 1e-12f ? 1 / count : (real)0;
    real xx[XX(G, G) + 1], xy[(G + 1) * C];
    UNROLL
    for (int k = 0; k <= XX(G, G); ++k) xx[k] = sums_xx[k] * per_pixel;
    UNROLL
    for (int k = 0; k < (G + 1) * C; ++k) xy[k] = sums_xy[k] * per_pixel;
    variance = variance / (n * n);
    real luminance = 0;
#pragma unroll
    for (int c = 0; c < C; ++c) luminance += BRIGHTNESS(c) * xy[c];
    luminance = MAX(luminance, 0);
    // The mean's square may be beyond float32.
    const float dim = 0.01f * mean[0] * mean[0] + 1e-30f;
    real ridge = noise_ridge * variance / (luminance * luminance + dim);
    ridge = MIN(ridge, 1);

    real coefficients[(G + 1) * C], zero = 0;  // stays 0 unless a coefficient is not finite
    least_squares(
        xx, xy, shifts, eps + ridge, eps_prime + ridge, ROUNDING * FLT_EPSILON, coefficients);
    UNROLL
    for (int i = 0; i < (Q + 1) * C; ++i) zero += 0 * coefficients[i];
    models += AT(x, y, pitch, MODELS);
    UNROLL
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

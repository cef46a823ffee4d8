// One level of adaptive FLR: the second pass of the window, along columns, and the models under it.

#include "vectors.h"
#include "sizes.h"
#include "grids.h"
#include "window.h"
#include "rows.h"
#define G (Q + 2 * POSITIONS)
#include "least_squares.h"

INLINE real along_column(global const float *row, const long *moved, const real *weights)
{
    real sum = 0;
#pragma unroll
    for (int t = 0; t < TAPS; ++t) sum += weights[t] * READ(row + moved[t]);
    return sum;
}

// The pass along columns, then least squares with a ridge that grows with the noise: the variance of
// the window's mean brightness, sum(w^2 r^2) / sum(w)^2, relative to the squared brightness.
//
// side: of a block in pixels. features: (FEATURES, h, STRIDE(pitch)). rows: from window_rows. model:
// (Q + 1, C, h, pitch). light: (Q + 2, h, pitch), models of the brightness and its variance.
// Global size (pitch / WIDTH, h).
kernel void fit(
    int h, int pitch, int side, float sigma, float eps, float eps_prime, float noise_ridge,
    float position_ridge, global const float *mean, constant float *shift,
    global const float *features, global const float *rows, global float *model,
    global float *light)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= pitch || y >= h) return;
    rows += ROWS_AT(x, y, pitch);
    int to_row[TAPS];
    long moved[TAPS];
    real weights[TAPS];
    column_weights(
        features + (long)y * STRIDE(pitch) + MARGIN + x, (long)h * STRIDE(pitch), STRIDE(pitch), y,
        h, sigma, to_row, weights);
#pragma unroll
    for (int t = 0; t < TAPS; ++t) moved[t] = (long)to_row[t] * pitch * ROWS;
#define DOWN(k) along_column(rows + (k) * GROUP, moved, weights)

    real xx[XX(G, G) + 1], xy[(G + 1) * C], shifts[G + 1], variance = 0;
    for (int k = 0; k < XY(0, 0); ++k) xx[k] = DOWN(k);
    for (int k = 0; k < (Q + 1) * C; ++k) xy[k] = DOWN(XY(0, 0) + k);
    for (int q = 0; q < Q; ++q) shifts[q] = shift[q];
#if POSITIONS
    shifts[Q] = shifts[Q + 1] = 0;
    for (int i = 0; i <= Q; ++i) xx[XX(Q + 1, i)] = DOWN(ROW_X(i));
    xx[XX(Q + 1, Q + 1)] = DOWN(ROW_XX);
    for (int c = 0; c < C; ++c) xy[(Q + 1) * C + c] = DOWN(ROW_X(Q + 1 + c));
#endif
#if NOISE
    real more[TAPS];
#pragma unroll
    for (int t = 0; t < TAPS; ++t) more[t] = weights[t] * weights[t];
    variance = along_column(rows + K * GROUP, moved, more);
#endif
#if POSITIONS
#pragma unroll
    for (int t = 0; t < TAPS; ++t) weights[t] *= (t - REACH) / sigma;
    for (int i = 0; i <= Q; ++i) xx[XX(Q + 2, i)] = DOWN(XX(i, 0));
    xx[XX(Q + 2, Q + 1)] = DOWN(ROW_X(0));
    for (int c = 0; c < C; ++c) xy[(Q + 2) * C + c] = DOWN(XY(0, c));
#pragma unroll
    for (int t = 0; t < TAPS; ++t) weights[t] *= (t - REACH) / sigma;
    xx[XX(Q + 2, Q + 2)] = DOWN(0);
    // Positions are centred on the window already, so only their own ridge is added.
    xx[XX(Q + 1, Q + 1)] += position_ridge * xx[0];
    xx[XX(Q + 2, Q + 2)] += position_ridge * xx[0];
#endif

    real zero = 0;  // stays 0 unless a moment is not finite
    for (int k = 0; k <= XX(G, G); ++k) zero += 0 * xx[k];
    for (int k = 0; k < (G + 1) * C; ++k) zero += 0 * xy[k];
    const mask filled = (xx[0] > 1e-12f) & (zero == 0);
    const real n = MAX(xx[0], 1e-12f) * side, per_pixel = filled ? 1 / xx[0] : (real)0;
    for (int k = 0; k <= XX(G, G); ++k) xx[k] = filled ? xx[k] * per_pixel : (real)0;
    for (int k = 0; k < (G + 1) * C; ++k) xy[k] = filled ? xy[k] * per_pixel : (real)0;
    variance = variance / (n * n);
    real level = 0;
#pragma unroll
    for (int c = 0; c < C; ++c) level += BRIGHTNESS(c) * xy[c];
    level = MAX(level, 0);
    real ridge = noise_ridge * variance / (level * level + 0.01f * mean[0] * mean[0]);
    ridge = MIN(ridge, 1);

    real coefficients[(G + 1) * C];
    least_squares(xx, xy, shifts, eps + ridge, eps_prime + ridge, coefficients);
    const long plane = (long)h * pitch, block = (long)y * pitch + x;
#pragma unroll
    for (int q = 0; q <= Q; ++q) {
        real brightness = 0;
#pragma unroll
        for (int c = 0; c < C; ++c) {
            WRITE(coefficients[q * C + c], model + (q * C + c) * plane + block);
            brightness += BRIGHTNESS(c) * coefficients[q * C + c];
        }
        WRITE(brightness, light + q * plane + block);
    }
    WRITE(variance, light + (Q + 1) * plane + block);
}

// The edge-aware window of adaptive FLR, first pass: along the rows.
//
//   m[k] = sum_t w_t plane[k](x + t)                      k = 0 .. K - 1
//   noise = sum_t w_t^2 plane[K](x + t)                   if NOISE
//   m_x[k] = sum_t w_t (t / sigma) plane(x + t)           the Q + 1 + C moments with 1
//   m_xx = sum_t w_t (t / sigma)^2 plane[0](x + t)        the last two if POSITIONS
//
// The position of block centres in the window is two more guides; a product with it is a pass whose
// weights are multiplied by it.

#include "vectors.h"
#include "sizes.h"
#include "grids.h"
#include "window.h"
#include "rows.h"

INLINE real along_row(global const float *plane, const real *weights)
{
    real sum = 0;
#pragma unroll
    for (int t = 0; t < TAPS; ++t) sum += weights[t] * READ(plane + t - REACH);
    return sum;
}

// planes: (K + NOISE, h, STRIDE(pitch)). features: (FEATURES, h, STRIDE(pitch)). rows: see rows.h.
// Global size (pitch / WIDTH, h).
kernel void window_rows(
    int h, int pitch, float sigma, global const float *features, global const float *planes,
    global float *rows)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= pitch || y >= h) return;
    const long plane = (long)h * STRIDE(pitch), block = (long)y * STRIDE(pitch) + MARGIN + x;
    planes += block;
    rows += ROWS_AT(x, y, pitch);
    real weights[TAPS], more[TAPS];
    row_weights(features + block, plane, sigma, weights);
    for (int k = 0; k < K; ++k) WRITE(along_row(planes + k * plane, weights), rows + k * GROUP);
#if NOISE
#pragma unroll
    for (int t = 0; t < TAPS; ++t) more[t] = weights[t] * weights[t];
    WRITE(along_row(planes + K * plane, more), rows + K * GROUP);
#endif
#if POSITIONS
#pragma unroll
    for (int t = 0; t < TAPS; ++t) more[t] = weights[t] * ((t - REACH) / sigma);
    for (int i = 0; i <= Q; ++i)
        WRITE(along_row(planes + XX(i, 0) * plane, more), rows + ROW_X(i) * GROUP);
    for (int c = 0; c < C; ++c)
        WRITE(along_row(planes + XY(0, c) * plane, more), rows + ROW_X(Q + 1 + c) * GROUP);
#pragma unroll
    for (int t = 0; t < TAPS; ++t) more[t] *= (t - REACH) / sigma;
    WRITE(along_row(planes, more), rows + ROW_XX * GROUP);
#endif
}

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

INLINE real along_row(global const float *p, int x, int pitch, const real *weights)
{
    real sum = 0;
    FOR_TAPS(p, K + NOISE, ADD_WEIGHTED)
    return sum;
}

// moments: (h, pitch / GROUP, K + NOISE, GROUP). rows: see rows.h. Global size (pitch / WIDTH, h).
kernel void window_rows(
    int h, int pitch, float sigma, global const float *features, global const float *moments,
    global float *rows)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= pitch || y >= h) return;
    moments += AT(x, y, pitch, K + NOISE);
    rows += AT(x, y, pitch, ROWS);
    real weights[TAPS], more[TAPS];
    row_weights(features, x, y, pitch, sigma, weights);
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

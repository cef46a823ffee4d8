// The edge-aware window over blocks, one line at a time. Comes after grids.h.
//
// Block i weighs block j of its row or column by
//   exp(-d^2 / (2 sigma^2)) exp(-|f_i - f_j|^2 / 2),   d = their distance in blocks
//
// Define: FEATURES, the number of planes of f.

#define TAPS (2 * REACH + 1)

// weights: TAPS are written. features: plane 0 at the block, planes `plane` apart. moved: how far
// each tap's block lies from it in memory.
INLINE void line_weights(
    global const float *features, long plane, const long *moved, float sigma, real *weights)
{
    real distance[TAPS];
#pragma unroll
    for (int t = 0; t < TAPS; ++t) {
        const float along = (t - REACH) / MAX(sigma, 1e-2f);
        distance[t] = along * along;
    }
    for (int f = 0; f < FEATURES; ++f) {
        const real here = READ(features + f * plane);
#pragma unroll
        for (int t = 0; t < TAPS; ++t) {
            const real apart = READ(features + f * plane + moved[t]) - here;
            distance[t] += apart * apart;
        }
    }
#pragma unroll
    for (int t = 0; t < TAPS; ++t) weights[t] = exp_below_0(-0.5f * distance[t]);
}

// The same along a row.
INLINE void row_weights(global const float *features, long plane, float sigma, real *weights)
{
    long moved[TAPS];
#pragma unroll
    for (int t = 0; t < TAPS; ++t) moved[t] = t - REACH;
    line_weights(features, plane, moved, sigma, weights);
}

// The same along a column, 0 outside the frame. rows: for each tap the distance to its row, 0
// instead of one that is outside.
INLINE void column_weights(
    global const float *features, long plane, int stride, int y, int h, float sigma, int *rows,
    real *weights)
{
    long moved[TAPS];
#pragma unroll
    for (int t = 0; t < TAPS; ++t) {
        const int row = y + t - REACH;
        rows[t] = row < 0 || row >= h ? 0 : row - y;
        moved[t] = (long)rows[t] * stride;
    }
    line_weights(features, plane, moved, sigma, weights);
#pragma unroll
    for (int t = 0; t < TAPS; ++t)
        if (rows[t] != t - REACH) weights[t] = 0;
}

// SPDX-License-Identifier: Apache-2.0
// The edge-aware window over blocks, one line at a time. Comes after grids.h.
//
// Block i weighs block j of its row or column by
//   exp(-d^2 / (2 sigma^2)) exp(-|f_i - f_j|^2 / 2),   d = their distance in blocks
//
// Define: REACH, blocks on each side that the window extends over, at most GROUP. refines: 1 if there is
// a coarser grid, 0 if not; f is then one plane more than the guides, and another one lies behind it.

#define TAPS (2 * REACH + 1)
#define FEATURE_PLANES (Q + 2 * refines)
#define ADD_WEIGHTED(t, v) sum += weights[t] * (v);

// FOR_TAPS(p, count, DO) does DO(t, v) for every tap t, v being what it has of plane p, at the blocks x
// to x + WIDTH - 1 of a row of length `pitch`. What lies outside the row is any of it.
#if REACH != 5
#error "FOR_TAPS is written for a REACH of 5"
#endif
#if WIDTH == 8
#define FOR_TAPS(p, count, DO)                                                                \
    {                                                                                         \
        const real own = READ(p);                                                             \
        const float16 left = (float16)(READ((p) - (x > 0 ? (count) * GROUP : 0)), own);       \
        const float16 right =                                                                 \
            (float16)(own, READ((p) + (x + GROUP < pitch ? (count) * GROUP : 0)));            \
        DO(0, left.s3456789a) DO(1, left.s456789ab) DO(2, left.s56789abc)                     \
        DO(3, left.s6789abcd) DO(4, left.s789abcde) DO(5, own) DO(6, right.s12345678)         \
        DO(7, right.s23456789) DO(8, right.s3456789a) DO(9, right.s456789ab)                  \
        DO(10, right.s56789abc)                                                               \
    }
#else
#define FOR_TAPS(p, count, DO)                                                                \
    for (int t = 0; t < TAPS; ++t) {                                                          \
        const int tap = CLAMP(x + t - REACH, 0, pitch - 1);                                   \
        DO(t, (p)[COLUMN(tap, count) - COLUMN(x, count)])                                     \
    }
#endif

// From squared distances to weights. sigma: in blocks.
INLINE void weigh(real *weights, float sigma)
{
    const float width = MAX(sigma, 1e-2f), narrow = 1 / (width * width);
#pragma unroll
    for (int t = 0; t < TAPS; ++t)
        weights[t] = exp_below_0(-0.5f * (weights[t] + (t - REACH) * (t - REACH) * narrow));
}

// TAPS weights along the row, 0 outside. features: (h, pitch / GROUP, FEATURE_PLANES, GROUP).
#define IN_ROW(i) (x + (i) + t - REACH >= 0 && x + (i) + t - REACH < pitch ? 1.0f : 0.0f)
INLINE void row_weights(
    global const float *features, int refines, int x, int y, int pitch, float sigma, real *weights)
{
    features += AT(x, y, pitch, FEATURE_PLANES);
#pragma unroll
    for (int t = 0; t < TAPS; ++t) weights[t] = 0;
    for (int f = 0; f < Q + refines; ++f) {
        global const float *p = features + f * GROUP;
        const real here = READ(p);
#define ADD_SQUARE(t, v) weights[t] += ((v) - here) * ((v) - here);
        FOR_TAPS(p, FEATURE_PLANES, ADD_SQUARE)
    }
    weigh(weights, sigma);
    if (x < REACH || x + WIDTH + REACH > pitch)
#pragma unroll
        for (int t = 0; t < TAPS; ++t) weights[t] *= LANES(real, IN_ROW);
}

// The same along the column. rows: how many rows each tap lies below, 0 for one that is outside.
INLINE void column_weights(
    global const float *features, int refines, int x, int y, int h, int pitch, float sigma,
    int *rows, real *weights)
{
    features += AT(x, y, pitch, FEATURE_PLANES);
#pragma unroll
    for (int t = 0; t < TAPS; ++t) {
        const int row = y + t - REACH;
        rows[t] = row < 0 || row >= h ? 0 : row - y;
        weights[t] = 0;
    }
    for (int f = 0; f < Q + refines; ++f) {
        const real here = READ(features + f * GROUP);
#pragma unroll
        for (int t = 0; t < TAPS; ++t) {
            const long moved = (long)rows[t] * pitch * FEATURE_PLANES;
            const real apart = READ(features + f * GROUP + moved) - here;
            weights[t] += apart * apart;
        }
    }
    weigh(weights, sigma);
#pragma unroll
    for (int t = 0; t < TAPS; ++t)
        if (rows[t] != t - REACH) weights[t] = 0;
}

// SPDX-License-Identifier: Apache-2.0
// The grid of blocks and the features of Eq. 8, for fit.cl and weighted_sum.cl. Comes after images.h.
//
// The first block begins offset_y rows above and offset_x columns left of the frame, less than BLOCK.
//
// Define: BLOCK, pixels on a side, a multiple of WIDTH.

#define SQUARES 3                     // of the position, the last guides
#define RANGES (Q + SQUARES)          // features that are scaled
#define M (1 + RANGES)                // columns of T
// Light is fitted times this, or sums over a block would leave float32 near its end.
#define LESS 0x1p-16f
#define ONE_BLOCK (2 * RANGES)        // in `ranges` (h, w, RANGES, 2): halves of lowest value and range

// low, spread: lowest value and range, both halved, since the range of all of float32 is beyond it.
INLINE real to_unit(real x, float low, float spread)
{
    return spread > 0 ? 2 * ((x / 2 - low) / spread) - 1 : (real)0;
}

// Column m of T (a constant once loops over m are unrolled). x: the guides. ranges: of the block.
INLINE real feature(const real *x, int m, global const float *ranges)
{
    if (m == 0) return 1;
    const int q = m <= Q ? m - 1 : m - 1 - SQUARES;
    const real t = to_unit(x[q], ranges[2 * q], ranges[2 * q + 1]);
    return m <= Q ? t : to_unit(t * t, ranges[2 * (m - 1)], ranges[2 * (m - 1) + 1]);
}

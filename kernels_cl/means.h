// SPDX-License-Identifier: Apache-2.0
// From sums over pixels to planes of moments as grids.h describes them. Comes after products.h and grids.h.
//
// Define: PLANES, how many.

// WIDTH divides BLOCK or is twice that; then one work-item covers two blocks side by side.
#define ACROSS (WIDTH > BLOCK ? 2 : 1)

// Writes the means over one block, or two side by side.
INLINE void write_means(const real *sums, global float *block)
{
    const float per_pixel = 1.0f / (BLOCK * BLOCK);
#if WIDTH == 8 && BLOCK == 4
#define FOURS (PLANES / 4 * 4)
#pragma unroll
    for (int k = 0; k < FOURS; k += 4) {
        const real both = per_pixel * half_sums(sums[k], sums[k + 1], sums[k + 2], sums[k + 3]);
        *(global unaligned_pair *)(block + k * GROUP) = both.s04;
        *(global unaligned_pair *)(block + (k + 1) * GROUP) = both.s15;
        *(global unaligned_pair *)(block + (k + 2) * GROUP) = both.s26;
        *(global unaligned_pair *)(block + (k + 3) * GROUP) = both.s37;
    }
#else
#define FOURS 0
#endif
#pragma unroll
    for (int k = FOURS; k < PLANES; ++k) {
#if WIDTH > BLOCK
        block[k * GROUP] = per_pixel * half_sum(sums[k].lo);
        block[k * GROUP + 1] = per_pixel * half_sum(sums[k].hi);
#else
        block[k * GROUP] = per_pixel * lane_sum(sums[k]);
#endif
    }
}

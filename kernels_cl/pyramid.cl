// Grids of blocks, each half as fine as the one before: means of 2 x 2 blocks, with zeros beyond the
// border.

#include "vectors.h"
#include "grids.h"

#if WIDTH == 1
#define PAIR_SUMS(p) ((p)[0] + (p)[1])
#else
INLINE real pair_sums(real first, real second)
{
#if WIDTH == 8
    const float16 both = (float16)(first, second);
#else
    const float8 both = (float8)(first, second);
#endif
    return both.even + both.odd;
}
#define PAIR_SUMS(p) pair_sums(READ(p), READ((p) + WIDTH))
#endif
#define IF_THERE(j) (2 * x + (j) < w ? upper[j] + lower[j] : 0)
#define ONE_SUM(i) (IF_THERE(2 * (i)) + IF_THERE(2 * (i) + 1))

// planes: (count, h, stride) with w columns from column `start` on. halves: (count, half_h,
// STRIDE(pitch)). Global size (STRIDE(pitch) / WIDTH, half_h, count).
kernel void halve(
    int count, int h, int w, int stride, int start, int half_h, int pitch, global const float *planes,
    global float *halves)
{
    const int column = (int)get_global_id(0) * WIDTH, x = column - MARGIN;
    const int y = get_global_id(1), plane = get_global_id(2);
    if (column >= STRIDE(pitch) || y >= half_h || plane >= count) return;
    global float *half_row = halves + ((long)plane * half_h + y) * STRIDE(pitch) + column;
    if (x < 0 || 2 * x >= w) {
        WRITE((real)0, half_row);
        return;
    }
    global const float *upper = planes + ((long)plane * h + 2 * y) * stride + start + 2 * x;
    const int last = 2 * y + 1 >= h;
    global const float *lower = last ? upper : upper + stride;
    real sums;
    if (2 * (x + WIDTH) <= w)
        sums = PAIR_SUMS(upper) + PAIR_SUMS(lower);
    else
        sums = LANES(real, ONE_SUM);
    // Below the last row there are zeros; `lower` repeats `upper` only so as to be readable.
    WRITE(sums * (last ? 0.125f : 0.25f), half_row);
}

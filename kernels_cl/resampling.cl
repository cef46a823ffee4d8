// SPDX-License-Identifier: Apache-2.0
// Grids of blocks, each half as fine as the one before: means of 2 x 2 blocks, with zeros beyond the
// border.

#include "vectors.h"
#include "grids.h"

// planes: h rows `row` apart of groups `group` apart of `count` planes `plane` apart, zero from column
// w on up to `pitch`. halves: (half_h, half_pitch / GROUP, count, GROUP).
// Global size (half_pitch / WIDTH, half_h).
kernel void halve(
    int count, int h, int pitch, int row, int group, int plane, int half_h, int half_pitch,
    global const float *planes, global float *halves)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= half_pitch || y >= half_h) return;
    halves += AT(x, y, half_pitch, count);
    const int next = 2 * x + WIDTH, below = 2 * y + 1 < h, there = next < pitch;
    const long second = (long)(next / GROUP - 2 * x / GROUP) * group + next % GROUP - 2 * x % GROUP;
    planes += (long)(2 * y) * row + (long)(2 * x / GROUP) * group + 2 * x % GROUP;
    if (2 * x >= pitch) {
        for (int k = 0; k < count; ++k) WRITE((real)0, halves + k * GROUP);
        return;
    }
    for (int k = 0; k < count; ++k) {
        global const float *upper = planes + (long)k * plane;
        real sums = pair_sums(upper, upper + second, there);
        if (below) sums += pair_sums(upper + row, upper + row + second, there);
        WRITE(sums / 4, halves + k * GROUP);
    }
}

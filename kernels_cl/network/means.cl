// SPDX-License-Identifier: Apache-2.0
// What the network reads of means over 2 x 2 values of a finer grid.

#include "vectors.h"
#include "grids.h"
#include "network/maps.h"
#include "network/read.h"

// from, means: maps of MEANS channels, the first twice as fine. to: a map of `to_count` channels, of
// which the last POOLED are written. part: 1 over the pixels of a mean.
// Global size ((pitch - MARGIN) / WIDTH, h + 2).
kernel void means(
    int h, int w, int pitch, int from_pitch, int to_count, int to_pitch, float part,
    global const float *from, global float *means, global float *to)
{
    const int x = (int)get_global_id(0) * WIDTH, y = (int)get_global_id(1) - 1;
    if (x >= pitch - MARGIN || y > h) return;
    to += MAP_AT(x, y, to_pitch, to_count, to_count - POOLED);
    if (x == 0)
        for (int k = 0; k < POOLED; ++k)
            for (int i = 1; i <= MARGIN; ++i) to[(long)k * to_pitch - i] = 0;
    const int inside = y >= 0 && y < h;
    real sums[MEANS];
    for (int k = 0; k < MEANS; ++k) {
        sums[k] = 0;
        for (int dy = 0; dy < 2 && inside; ++dy) {
            global const float *p = from + MAP_AT(2 * x, 2 * y + dy, from_pitch, MEANS, k);
            const real a = READ(p), b = READ(p + WIDTH);
            sums[k] += 0.25f * (EVEN(a, b) + ODD(a, b));
        }
        if (inside) WRITE(sums[k], means + MAP_AT(x, y, pitch, MEANS, k));
    }
    if (inside) write_means(sums, part, to_pitch, to);
    for (int k = 0; k < POOLED; ++k)
        for (int i = inside ? MAX(w - x, 0) : 0; i < WIDTH; ++i) to[(long)k * to_pitch + i] = 0;
}

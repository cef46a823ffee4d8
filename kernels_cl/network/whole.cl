// What the network reads of the whole frame: two channels of one value each.
//
// Define beside those of the headers: CHANNELS, those of the map, of which these are the last.

#include "vectors.h"
#include "grids.h"
#include "network/maps.h"

// partial: (h, 2), sums over each row of the two planes of `light`, see features.cl. Global size (h).
kernel void whole_rows(int h, int w, int pitch, global const float *light, global float *partial)
{
    const int y = get_global_id(0);
    if (y >= h) return;
    for (int k = 0; k < 2; ++k) {
        float sum = 0;
        for (int x = 0; x < w; ++x) sum += light[AT(x, y, pitch, 2) + k * GROUP];
        partial[2 * y + k] = sum;
    }
}

// values: how much brighter the denoised light is than the noisy one, and the mean logarithm.
// One work-item.
kernel void whole_means(
    int h, int w, global const float *mean, global const float *partial, global float *values)
{
    if (get_global_id(0) > 0) return;
    float sums[2] = {0, 0};
    for (int y = 0; y < h; ++y)
        for (int k = 0; k < 2; ++k) sums[k] += partial[2 * y + k];
    values[0] = log(sums[0] / ((float)h * w) / mean[0] + 0.1f);
    values[1] = sums[1] / ((float)h * w);
}

// Global size ((pitch - MARGIN) / WIDTH, h).
kernel void whole(int h, int pitch, global const float *values, global float *map)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= pitch - MARGIN || y >= h) return;
    for (int k = 0; k < 2; ++k)
        WRITE((real)values[k], map + MAP_AT(x, y, pitch, CHANNELS, CHANNELS - 2 + k));
}

// BMFR, phase III: the mean of the fitted light over time, multiplied by albedo (Koskela et al. 2019,
// section 3.5).

#define WIDTH 1
#include "vectors.h"
#include "bmfr/taps.h"
#include "bmfr/colours.h"

// Global size (W, H). All images (H, W, 3), but motion (H, W, 2), count and accepted (H, W). accepted,
// count: from phase I. picture: in luma, orange and green.
kernel void accumulate_fitted(
    int width, int height, float least, global const float *fitted, global const float *albedo,
    global const float *motion, global const uchar *accepted, global const float *count,
    global const float *before_mean, global float *mean, global float *picture)
{
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height) return;
    const long pixel = (long)y * width + x;
    Taps taps = find_taps(motion + 2 * pixel, x, y, width, height);
#pragma unroll
    for (int i = 0; i < 4; ++i) taps.weight[i] *= accepted[pixel] >> i & 1;
    const float seen = normalise(&taps);
    const float3 before = gather(before_mean, &taps, width);
    const float share = seen > 0 ? MAX(1 / MAX(count[pixel], 1), least) : 1;
    const float3 mixed = before + share * (vload3(pixel, fitted) - before);
    vstore3(mixed, pixel, mean);
    vstore3(to_ycocg(vload3(pixel, albedo) * mixed), pixel, picture);
}

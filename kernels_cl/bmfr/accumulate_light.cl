// BMFR, phase I: the mean of the noisy samples at each place, with an age limit (Koskela et al. 2019,
// section 3.2).
//
// Define: DEPTHS, if the frames have no position; surfaces are then told apart by their depth.

#define WIDTH 1
#include "vectors.h"
#include "bmfr/taps.h"

// Whether two pixels show one surface, see `_alike` in jflnr/temporal/reproject.py.
INLINE int alike(
    float3 normal, float3 position, float depth, float3 normal_there, float3 position_there,
    float depth_there, float tolerance, float same_normal)
{
#ifdef DEPTHS
    const float apart = depth_there - depth;
#else
    const float apart = DOT(normal, position_there - position);
#endif
    const int turned = DOT(normal, normal_there) < same_normal;
    return fabs(apart) <= tolerance && !turned && depth > 0 && depth_there > 0;
}

// Global size (W, H). All images (H, W, 3), but motion (H, W, 2), depth, count and accepted (H, W).
// before_...: of the previous frame; where its count is 0 nothing is taken from it. accepted: bit i for
// tap i, for phase III.
kernel void accumulate_light(
    int width, int height, float off_plane, float same_normal, float least,
    global const float *sample, global const float *motion, global const float *normal,
    global const float *depth, global const float *position, global const float *before_normal,
    global const float *before_depth, global const float *before_position,
    global const float *before_count, global const float *before_light, global float *light,
    global float *count, global uchar *accepted)
{
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height) return;
    const long pixel = (long)y * width + x;
    motion += 2 * pixel;
    Taps taps = find_taps(motion, x, y, width, height);
    const float3 here = vload3(pixel, normal), point = vload3(pixel, position);
    const float moved = MAX(fabs(motion[0]), fabs(motion[1])) / width;
    const float tolerance = (off_plane + moved) * depth[pixel];
    int bits_of = 0;
#pragma unroll
    for (int i = 0; i < 4; ++i) {
        if (!(taps.weight[i] > 0)) continue;
        const long tap = TAP(taps, i);
        const int accept =
            before_count[tap] > 0 && alike(
                                         here, point, depth[pixel], vload3(tap, before_normal),
                                         vload3(tap, before_position), before_depth[tap],
                                         tolerance, same_normal);
        taps.weight[i] = accept ? taps.weight[i] : 0;
        bits_of |= accept << i;
    }
    normalise(&taps);
    float samples = 0;
#pragma unroll
    for (int i = 0; i < 4; ++i)
        if (taps.weight[i] > 0) samples += taps.weight[i] * before_count[TAP(taps, i)];

    const float3 own = vload3(pixel, sample), mean = gather(before_light, &taps, width);
    const int usable = FINITE(own);
    samples = rint(samples) + usable;
    const float share = MAX(1 / MAX(samples, 1), least);
    vstore3(usable ? mean + share * (own - mean) : mean, pixel, light);
    count[pixel] = samples;
    accepted[pixel] = bits_of;
}

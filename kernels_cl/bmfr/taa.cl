// BMFR, phase III: temporal anti-aliasing (Karis 2014, "High Quality Temporal Supersampling"). The
// previous result is brought into the range around the pixel, the mean of those of 5 and of 9 pixels.

#define WIDTH 1
#include "vectors.h"
#include "bmfr/taps.h"
#include "bmfr/colours.h"

#define MIN_3(a, b) (float3)(MIN((a).x, (b).x), MIN((a).y, (b).y), MIN((a).z, (b).z))
#define MAX_3(a, b) (float3)(MAX((a).x, (b).x), MAX((a).y, (b).y), MAX((a).z, (b).z))

// Whether the place lies among the centres of the previous frame's pixels.
INLINE int was_inside(global const float *motion, int x, int y, int width, int height)
{
    const float column = x + motion[0], row = y + motion[1];
    return column >= 0 && column <= width - 1 && row >= 0 && row <= height - 1;
}

// Global size (W, H). picture: from accumulate_fitted. before: the previous result. surface: (H, W).
// result: (H, W, 3). image: the same divided by albedo, the mean of phase III where that is dark.
kernel void taa(
    int width, int height, float share, float dark, global const float *picture,
    global const float *before, global const float *motion, global const float *albedo,
    global const float *surface, global const float *mean, global float *result,
    global float *image)
{
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height) return;
    const long pixel = (long)y * width + x;
    const float3 own = vload3(pixel, picture);
    float3 low = own, high = own, low_corner = own, high_corner = own;
#pragma unroll
    for (int i = 0; i < 9; ++i) {
        const int column = CLAMP(x + i % 3 - 1, 0, width - 1), row = CLAMP(y + i / 3 - 1, 0, height - 1);
        const float3 near = vload3((long)row * width + column, picture);
        if (i % 2) {
            low = MIN_3(low, near);
            high = MAX_3(high, near);
        } else {
            low_corner = MIN_3(low_corner, near);
            high_corner = MAX_3(high_corner, near);
        }
    }
    low = (low + MIN_3(low, low_corner)) / 2;
    high = (high + MAX_3(high, high_corner)) / 2;

    float3 mixed = own;
    motion += 2 * pixel;
    if (was_inside(motion, x, y, width, height)) {
        const Taps taps = find_taps(motion, x, y, width, height);
        float3 old = to_ycocg(gather(before, &taps, width));
        old = MAX_3(MIN_3(old, high), low);
        mixed = old + share * (own - old);
    }
    const float3 shown = to_rgb(mixed), divisor = vload3(pixel, albedo), rest = vload3(pixel, mean);
    vstore3(shown, pixel, result);
    const int bright = surface[pixel] > 0;
    vstore3(
        (float3)(
            bright && divisor.x > dark ? shown.x / divisor.x : rest.x,
            bright && divisor.y > dark ? shown.y / divisor.y : rest.y,
            bright && divisor.z > dark ? shown.z / divisor.z : rest.z),
        pixel, image);
}

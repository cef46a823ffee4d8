// SPDX-License-Identifier: Apache-2.0
// BMFR, phase III: temporal anti-aliasing (Karis 2014, "High Quality Temporal Supersampling"). The
// previous result is brought into the range around the pixel, the mean of those of 5 and of 9 pixels.

#include "vectors.h"
#include "sizes.h"
#include "images.h"
#include "bmfr/taps.h"
#include "bmfr/colours.h"

#define NEAR(i) row[CLAMP(x + (i), 0, width - 1)]
INLINE real near_lanes(global const float *row, int x, int width)
{
    if (x >= 0 && x + WIDTH <= width) return READ(row + x);
    return LANES(real, NEAR);
}

// The range of one channel around the pixels x to x + WIDTH - 1 of a row.
INLINE void neighbourhood(
    global const float *plane, int x, int y, int width, int height, real *low, real *high)
{
    real low_of_9 = INFINITY, high_of_9 = -INFINITY;
    *low = INFINITY;
    *high = -INFINITY;
#pragma unroll
    for (int i = 0; i < 9; ++i) {
        global const float *row = plane + (long)CLAMP(y + i / 3 - 1, 0, height - 1) * width;
        const real v = near_lanes(row, x + i % 3 - 1, width);
        low_of_9 = MIN(low_of_9, v);
        high_of_9 = MAX(high_of_9, v);
        if (i % 2 || i == 4) {
            *low = MIN(*low, v);
            *high = MAX(*high, v);
        }
    }
    *low = (*low + low_of_9) / 2;
    *high = (*high + high_of_9) / 2;
}

// Global size (W / WIDTH, H). picture: (3, H, W), from accumulate_fitted. before: (H, W, 3), the previous
// result, whose pixels count where before_count, (H, W), is above 0. surface: (H, W). result: (H, W, 3).
// image: the same divided by albedo, or, where that is at most `dark`, the mean of phase III.
kernel void taa(
    int width, int height, float share, float dark, global const float *picture,
    global const float *before, global const float *before_count, global const float *motion,
    global const float *albedo, global const float *surface, global const float *mean,
    global float *result, global float *image)
{
    const int x = FIRST_PIXEL(width), y = get_global_id(1);
    if ((int)get_global_id(0) * WIDTH >= width || y >= height) return;
    const long pixel = (long)y * width + x, plane = (long)height * width;
    const real motion_x = OWN(motion, 2, 0), motion_y = OWN(motion, 2, 1);
    const real there_x = LANES(real, LANE_NUMBER) + x + motion_x, there_y = y + motion_y;
    const mask was_inside =
        (there_x >= 0) & (there_x <= width - 1) & (there_y >= 0) & (there_y <= height - 1);
    Taps taps = find_taps(motion_x, motion_y, x, y, width, height);
#pragma unroll
    for (int i = 0; i < 4; ++i) {
        const real known = at(before_count, 1, 0, taps.pixel[i], taps.together[i]);
        taps.weight[i] = known > 0 ? taps.weight[i] : (real)0;
    }
    const mask was_there = was_inside & (normalise(&taps) > 0);

    real shown[3], old[3], image_of[3];
#pragma unroll
    for (int c = 0; c < 3; ++c) old[c] = gather(before, 3, c, &taps);
    to_ycocg(old);
#pragma unroll
    for (int c = 0; c < 3; ++c) {
        real low, high;
        neighbourhood(picture + c * plane, x, y, width, height, &low, &high);
        const real own = READ(picture + c * plane + pixel), held = CLAMP(old[c], low, high);
        shown[c] = was_there ? held + share * (own - held) : own;
    }
    to_rgb(shown);
    write_pixels(result + pixel * 3, shown, 0, WIDTH - 1);
    const mask covered = READ(surface + pixel) > 0;
#pragma unroll
    for (int c = 0; c < 3; ++c) {
        const real divisor = usable_albedo(OWN(albedo, 3, c));
        const real quotient = shown[c] / divisor;
        image_of[c] = (covered & (divisor > dark)) ? quotient : OWN(mean, 3, c);
    }
    write_pixels(image + pixel * 3, image_of, 0, WIDTH - 1);
}

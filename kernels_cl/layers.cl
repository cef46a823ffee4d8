// SPDX-License-Identifier: Apache-2.0
// The layers of a picture, (H, W, C), as planes for the filter along edges (edges.cl), and back.
//
// What is brighter than white is steered by the share of the brightest pixel nearby that it covers.
//
// Defines: those of images.h, for one image of C channels. Global size (ceil(W / WIDTH), H).

#include "vectors.h"
#include "sizes.h"
#include "images.h"
#include "planes.h"

#define REACH 3

#define PLACE                                                                         \
    const int x0 = (int)get_global_id(0) * WIDTH, y = get_global_id(1);               \
    if (x0 >= width || y >= height) return;                                           \
    const long size = (long)height * width, line = (long)y * width, pixel = line + x0

// planes: (..., H, W), those from `first` on are written. usable: (H, W), 0 where any value is not
// finite; 1 elsewhere, if `first` is 0.
kernel void spread(
    int width, int height, int first, global const float *image, global float *planes,
    global float *usable)
{
    PLACE;
    const int last = MIN(width - x0, WIDTH) - 1;
    real counts = first == 0 ? (real)1 : lanes_at(usable + line, width, x0);
#pragma unroll
    for (int c = 0; c < C; ++c) {
        const real value = guide_lanes(image + pixel * C, C, c, 0, last);
        counts = 0 * value == 0 ? counts : (real)0;
        write_lanes(planes + (first + c) * size + pixel, width, x0, value);
    }
    write_lanes(usable + pixel, width, x0, counts);
}

// The brightest channel, or the mean of the three if `mean`; 0 for what is not finite.
kernel void peaks(
    int width, int height, int first, int mean, global const float *planes, global float *peak)
{
    PLACE;
    real sum = 0, most = 0;
#pragma unroll
    for (int c = 0; c < C; ++c) {
        const real value = lanes_at(planes + (first + c) * size + line, width, x0);
        sum += value;
        most = 0 * value == 0 ? MAX(most, value) : most;
    }
    sum = 0 * sum == 0 ? sum / C : (real)0;
    write_lanes(peak + pixel, width, x0, mean ? sum : most);
}

// The most of 7 pixels, down or across.
kernel void most(
    int width, int height, int down, global const float *image, global float *result)
{
    PLACE;
    real found = lanes_at(image + line, width, x0);
#pragma unroll
    for (int i = -REACH; i <= REACH; ++i) {
        const int row = down ? CLAMP(y + i, 0, height - 1) : y;
        const real value = lanes_at(image + (long)row * width, width, down ? x0 : x0 + i);
        found = MAX(found, value);
    }
    write_lanes(result + pixel, width, x0, found);
}

// What tells edges: `factor` times the planes, or if `covers` over the peaks nearby, which are at
// least `least`; of the mean of the three if `mean`. steer: (..., H, W), from `to` on.
kernel void steer(
    int width, int height, int first, int mean, int covers, float factor, float least, int to,
    global const float *planes, global const float *peak, global const float *usable,
    global float *steer)
{
    PLACE;
    const real counts = lanes_at(usable + line, width, x0);
    real over = factor, sum = 0;
    if (covers) {
        const real most = lanes_at(peak + line, width, x0);
        over = 1 / MAX(most, least);
    }
#pragma unroll
    for (int c = 0; c < C; ++c) {
        const real value = lanes_at(planes + (first + c) * size + line, width, x0);
        sum += value / C;
        if (!mean)
            write_lanes(
                steer + (to + c) * size + pixel, width, x0, counts > 0 ? value * over : (real)0);
    }
    if (mean)
        write_lanes(steer + to * size + pixel, width, x0, counts > 0 ? sum * over : (real)0);
}

// The inverse of `spread`, of `averages`, or of `planes` where no more than `nothing` was averaged.
// number: (H, W).
kernel void gather(
    int width, int height, int first, float nothing, global const float *number,
    global const float *averages, global const float *planes, global float *image)
{
    PLACE;
    const real counts = lanes_at(number + line, width, x0);
    real values[C];
#pragma unroll
    for (int c = 0; c < C; ++c) {
        const long at = (first + c) * size + line;
        const real average = lanes_at(averages + at, width, x0);
        values[c] = counts > nothing ? average : lanes_at(planes + at, width, x0);
    }
    write_pixels(image + pixel * C, values, 0, MIN(width - x0, WIDTH) - 1);
}

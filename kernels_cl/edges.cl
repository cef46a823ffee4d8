// SPDX-License-Identifier: Apache-2.0
// Planes averaged along the edges that others tell: the filter of features and of detail.
//
//   weight of the pixel p + d at p = exp(-(d' S d / a^2 + |d|^2 / w^2 + |n_p - n_(p + d)|^2 / (b a)^2) / 2)
//
// n are the planes that tell the edges, blurred; S is what they change over a step, the sums of
// products of their gradients, blurred three times; a is how far they may differ at p.
//
// Planes are (planes, H, W) without padding. Outside nothing counts; blurs repeat the border.
//
// Defines beside those of vectors.h: for `average` STEERING and FOLLOWING, planes of n and of what is
// averaged; REACH, pixels on each side of the window.

#include "vectors.h"
#include "planes.h"

// The mean over 3 x 3 pixels with the weights 1, 2, 1. Global size (ceil(W / WIDTH), H, planes).
kernel void blur(
    int width, int height, int planes, global const float *image, global float *blurred)
{
    const int x0 = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x0 >= width || y >= height || get_global_id(2) >= planes) return;
    const long plane = (long)get_global_id(2) * height;
    real sum = 0;
#pragma unroll
    for (int i = -1; i <= 1; ++i) {
        global const float *row = image + (plane + CLAMP(y + i, 0, height - 1)) * width;
        const real across = lanes_at(row, width, x0 - 1) + 2 * lanes_at(row, width, x0) +
                            lanes_at(row, width, x0 + 1);
        sum += (i == 0 ? 2 : 1) * across;
    }
    write_lanes(blurred + (plane + y) * width + x0, width, x0, sum / 16);
}

// Products of the gradients of all planes: down by down, down by right, right by right, (3, H, W).
// Global size (ceil(W / WIDTH), H).
kernel void structure(
    int width, int height, int planes, global const float *image, global float *products)
{
    const int x0 = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x0 >= width || y >= height) return;
    real sums[3] = {0, 0, 0};
    for (int k = 0; k < planes; ++k) {
        global const float *plane = image + (long)k * height * width, *row = plane + (long)y * width;
        const real down = lanes_at(plane + (long)MIN(y + 1, height - 1) * width, width, x0) -
                          lanes_at(plane + (long)MAX(y - 1, 0) * width, width, x0);
        const real right = lanes_at(row, width, x0 + 1) - lanes_at(row, width, x0 - 1);
        sums[0] += down * down / 4;
        sums[1] += down * right / 4;
        sums[2] += right * right / 4;
    }
#pragma unroll
    for (int k = 0; k < 3; ++k)
        write_lanes(products + ((long)k * height + y) * width + x0, width, x0, sums[k]);
}

#ifdef FOLLOWING
// number: how many pixels of equal weight tell as much, (H, W). averages: (FOLLOWING, H, W), 0 where
// nothing counts. near: n, (STEERING, H, W). tensor: S, (3, H, W). usable: (H, W), 1 or 0. alike: a,
// (H, W). per_pixel: 1 / w^2. per_difference: 1 / b^2. Global size (ceil(W / WIDTH), H).
#define INSIDE(i) (x0 + j + (i) >= 0 && x0 + j + (i) < width ? 1.0f : 0.0f)
kernel void average(
    int width, int height, float per_pixel, float per_difference, global const float *near,
    global const float *tensor, global const float *follow, global const float *usable,
    global const float *alike, global float *number, global float *averages)
{
    const int x0 = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x0 >= width || y >= height) return;
    const long size = (long)height * width, line = (long)y * width;
    const real a = lanes_at(alike + line, width, x0), sharp = 1 / (a * a);
    real steep[3], here[STEERING], sums[FOLLOWING], total = 0, squares = 0;
#pragma unroll
    for (int k = 0; k < 3; ++k) steep[k] = lanes_at(tensor + k * size + line, width, x0) * sharp;
#pragma unroll
    for (int k = 0; k < STEERING; ++k) here[k] = lanes_at(near + k * size + line, width, x0);
#pragma unroll
    for (int k = 0; k < FOLLOWING; ++k) sums[k] = 0;
    for (int i = -REACH; i <= REACH; ++i) {
        if (y + i < 0 || y + i >= height) continue;
        const long other = line + (long)i * width;
        for (int j = -REACH; j <= REACH; ++j) {
            real counts = lanes_at(usable + other, width, x0 + j);
            if (x0 + j < 0 || x0 + j + WIDTH > width) counts *= LANES(real, INSIDE);
            real apart = 0;
#pragma unroll
            for (int k = 0; k < STEERING; ++k) {
                const real step = lanes_at(near + k * size + other, width, x0 + j) - here[k];
                apart += step * step;
            }
            apart *= per_difference * sharp;
            apart += i * i * steep[0] + 2 * i * j * steep[1] + j * j * steep[2];
            apart += (i * i + j * j) * per_pixel;
            const real weight = counts * exp_below_0(-0.5f * apart);
            total += weight;
            squares += weight * weight;
#pragma unroll
            for (int k = 0; k < FOLLOWING; ++k) {
                const real value = lanes_at(follow + k * size + other, width, x0 + j);
                sums[k] += weight * (counts > 0 ? value : (real)0);
            }
        }
    }
    total = MAX(total, 1e-12f);
    write_lanes(number + line + x0, width, x0, total * total / MAX(squares, 1e-12f));
#pragma unroll
    for (int k = 0; k < FOLLOWING; ++k)
        write_lanes(averages + k * size + line + x0, width, x0, sums[k] / total);
}
#endif

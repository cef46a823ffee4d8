// SPDX-License-Identifier: Apache-2.0
// How much of the fitted difference to the history is signal: host side in
// jflnr/opencl/temporal_change.py, twin in jflnr/temporal/change.py, which says why.

#include "vectors.h"
#include "sizes.h"
#include "grids.h"
#include "window.h"
#include "models.h"

#define NO_COARSER_GRID 0
#define GLOBAL_BLOCK                                                        \
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);      \
    if (x >= pitch || y >= h) return;

// From the moments of difference.cl's five channels to those of three, the noise, and the history's
// brightness: grids as in grids.h, of K + 1 planes and one. moments: (K of C = 5, h, from_pitch).
kernel void arrange(
    int h, int w, int pitch, int from_pitch, global const float *moments, global float *grid,
    global float *luminance)
{
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= pitch || y >= h) return;
    const long from = (long)y * from_pitch + x, plane = (long)h * from_pitch;
#define FROM(k) (x < w ? moments[(long)(k) * plane + from] : 0)
#define FROM_XY(i, c) FROM(XY(0, 0) + (i) * 5 + (c))
    global float *to = grid + AT(x, y, pitch, K + 1);
    for (int k = 0; k < XY(0, 0); ++k) to[k * GROUP] = FROM(k);
    for (int i = 0; i <= Q; ++i)
        for (int c = 0; c < 3; ++c) to[XY(i, c) * GROUP] = FROM_XY(i, c);
    to[K * GROUP] = FROM_XY(0, 3);
    const float count = FROM(0);
    luminance[AT(x, y, pitch, 1)] = FROM_XY(0, 4) / MAX(count, 1e-12f);
}

// What is averaged over the windows, five planes: the fit's squared brightness and its variance, both
// relative; that squared brightness, the history's, and 1.
#define PLANES 5
kernel void measure(
    int h, int pitch, float dim, float guide_scale, global const float *moments,
    global const float *features, global const float *models, global const float *luminance,
    global float *planes)
{
    GLOBAL_BLOCK
    features += AT(x, y, pitch, Q);
    models += AT(x, y, pitch, MODELS);
    planes += AT(x, y, pitch, PLANES);
    real found = READ(models + LIGHT_PLANE(0) * GROUP);
    for (int q = 0; q < Q; ++q)
        found += READ(features + q * GROUP) / guide_scale * READ(models + LIGHT_PLANE(q + 1) * GROUP);
    const real old = READ(luminance + AT(x, y, pitch, 1)), relative = 1 / ((old + dim) * (old + dim));
    const mask there = READ(moments + AT(x, y, pitch, K + 1)) > 1e-12f;
    const real values[PLANES] = {
        found * found * relative, READ(models + VARIANCE * GROUP) * relative, found * found,
        old * old, (real)1};
    for (int k = 0; k < PLANES; ++k) WRITE(there ? values[k] : (real)0, planes + k * GROUP);
}

kernel void change_rows(
    int h, int pitch, float sigma, global const float *features, global const float *planes,
    global float *rows)
{
    GLOBAL_BLOCK
    real weights[TAPS];
    row_weights(features, NO_COARSER_GRID, x, y, pitch, sigma, weights);
    const long block = AT(x, y, pitch, PLANES);
    for (int k = 0; k < PLANES; ++k) {
        global const float *p = planes + block + k * GROUP;
        real sum = 0;
        FOR_TAPS(p, PLANES, ADD_WEIGHTED)
        WRITE(sum, rows + block + k * GROUP);
    }
}

// The window along columns, then the share. before, evidence: power and noise, grids of two planes.
// model: (Q + 1, C, h, pitch), the share of the models. wrong: (h, pitch), noise of the history.
kernel void judge(
    int h, int pitch, float sigma, float caution, float newest, float followed, float novelty,
    global const float *features, global const float *moments, global const float *rows,
    global const float *models, global const float *before, global float *evidence,
    global float *model, global float *wrong)
{
    GLOBAL_BLOCK
    int to_row[TAPS];
    real weights[TAPS], sums[PLANES];
    column_weights(features, NO_COARSER_GRID, x, y, h, pitch, sigma, to_row, weights);
    rows += AT(x, y, pitch, PLANES);
    for (int k = 0; k < PLANES; ++k) {
        sums[k] = 0;
#pragma unroll
        for (int t = 0; t < TAPS; ++t)
            sums[k] += weights[t] * READ(rows + k * GROUP + (long)to_row[t] * pitch * PLANES);
    }
    const long two = AT(x, y, pitch, 2);
    real power = READ(before + two), noise = READ(before + two + GROUP);
    power += newest * (sums[0] - power);
    power = MAX(power, 1e-12f);
    noise += newest * (sums[1] - noise);
    const mask there = READ(moments + AT(x, y, pitch, K + 1)) > 1e-12f;
    const real signal = power - caution * noise;
    const real share = (there & (signal > 0)) ? signal / power : (real)0;
    WRITE(power * (1 - followed * share), evidence + two);
    WRITE(noise, evidence + two + GROUP);
    const real new_light = share * share * sums[2];
    const long block = (long)y * pitch + x, plane = (long)h * pitch;
    WRITE(novelty * new_light / (new_light + sums[3] + 0.01f * sums[4] + 1e-12f), wrong + block);
    models += AT(x, y, pitch, MODELS);
    for (int k = 0; k < (Q + 1) * C; ++k)
        WRITE(share * READ(models + k * GROUP), model + k * plane + block);
}

// A block at a time: where something that has no history comes into view, what the history around it
// takes on. known: (H, W), 1 where there is a history. covered: (H, W), above 0 where there is
// something to denoise. wrong: (h, pitch). Global size (w, h).
kernel void add_uncovered(
    int height, int width, int pitch, int block, float uncovered, global const float *known,
    global const float *covered, global float *wrong)
{
    const int x = get_global_id(0), y = get_global_id(1);
    const int right = MIN((x + 1) * block, width), bottom = MIN((y + 1) * block, height);
    if (x * block >= width || y * block >= height) return;
    float all = 0, old = 0;
    for (int row = y * block; row < bottom; ++row)
        for (int column = x * block; column < right; ++column) {
            const long pixel = (long)row * width + column;
            all += covered[pixel] > 0 ? 1 : 0;
            old += known[pixel];
        }
    wrong[(long)y * pitch + x] += MIN((all - old) / MAX(uncovered * all, 1e-12f), 1);
}

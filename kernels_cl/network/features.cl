// What the network reads (jflnr/network/features.py), in a map on blocks twice as large as the finest.
//
// Defines beside those of the headers: COUNT, the number of planes of moments; CHANNELS, those of the
// map; MOST_SPREAD, above which a guide's variance is cut; LOG, if `spread` and `tent` give light as
// log_light does.

#include "vectors.h"
#include "sizes.h"
#include "grids.h"
#include "models.h"
#include "network/maps.h"
#include "network/logarithms.h"
#include "network/step.h"

#ifdef LOG
#define AS_READ(light) log_light(light, mean[0])
#else
#define AS_READ(light) (light)
#endif

// Outputs of `of_step`, `tent` and `spread` lie in a grid or in a map: plane k of block (x, y) at
//   start + y row + (x / GROUP) group + k plane + x % GROUP
#define OUTPUT_PARAMETERS int start, int row, int group, int plane, global float *output
#define OUTPUT (output + start + (long)y * row + (long)(x / GROUP) * group + x % GROUP)

// OF_STEP planes of one level. level: a plane of `features`, of `feature_planes`, from features.cl.
// Global size (pitch / WIDTH, h).
kernel void of_step(
    int h, int pitch, int coarse_h, int coarse_w, int coarse_pitch, int feature_planes,
    global const float *mean, global const float *moments, global const float *features,
    global const float *fine, global const float *coarse, global const float *share,
    OUTPUT_PARAMETERS)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= pitch || y >= h) return;
    const coarse_t at = coarse_at(coarse, MODELS, coarse_h, coarse_w, coarse_pitch, x, y);
    const coarse_t share_at = coarse_at(share, 1, coarse_h, coarse_w, coarse_pitch, x, y);
    real guides[Q + 1], values[OF_STEP];
    mean_guides(moments + AT(x, y, pitch, COUNT), guides);
    const real level = READ(features + AT(x, y, pitch, feature_planes) + (feature_planes - 1) * GROUP);
    step_values(
        guides, level, fine + AT(x, y, pitch, MODELS), &at, &share_at, mean[0], values);
    for (int k = 0; k < OF_STEP; ++k) WRITE(values[k], OUTPUT + (long)k * plane);
}

// Mean light under weights 1, 2, 1 along rows and columns, of a grid of moments; one plane.
// Global size (pitch / WIDTH, h).
#define NEIGHBOUR(i) (x + (i) + dx < 0 || x + (i) + dx >= pitch ? 0 : line[COLUMN(x + (i) + dx, COUNT)])
kernel void tent(
    int h, int pitch, global const float *mean, global const float *moments, OUTPUT_PARAMETERS)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= pitch || y >= h) return;
    real n = 0, light = 0;
    for (int dy = -1; dy <= 1; ++dy) {
        if (y + dy < 0 || y + dy >= h) continue;
        for (int dx = -1; dx <= 1; ++dx) {
            const float weight = (2 - dx * dx) * (2 - dy * dy) / 16.0f;
            global const float *line = moments + AT(0, y + dy, pitch, COUNT);
            n += weight * LANES(real, NEIGHBOUR);
            line += XY(0, 0) * GROUP;
            for (int c = 0; c < C; ++c, line += GROUP)
                light += weight * BRIGHTNESS(c) * LANES(real, NEIGHBOUR);
        }
    }
    WRITE(AS_READ(light / MAX(n, 1e-9f)), OUTPUT);
}

// `count` planes of the grid half as fine, interpolated. Global size (pitch / WIDTH, h).
kernel void spread(
    int h, int pitch, int coarse_h, int coarse_w, int coarse_pitch, int count,
    global const float *mean, global const float *coarse, OUTPUT_PARAMETERS)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= pitch || y >= h) return;
    const coarse_t at = coarse_at(coarse, count, coarse_h, coarse_w, coarse_pitch, x, y);
    for (int k = 0; k < count; ++k) WRITE(AS_READ(doubled(&at, k)), OUTPUT + (long)k * plane);
}

// Writes a plane of the finest blocks to four channels of the map, 2 x 2 blocks side by side; beyond
// the border the last blocks are repeated.
INLINE void pack(
    real value, int k, int x, int y, int h, int w, int map_pitch, global float *map)
{
    for (int lower = y % 2; lower <= (y == h - 1 ? 1 : y % 2); ++lower) {
        global float *even = map + MAP_AT(0, y / 2, map_pitch, CHANNELS, 4 * k + 2 * lower);
        global float *odd = even + map_pitch;
#if WIDTH == 1
        (x % 2 ? odd : even)[x / 2] = value;
#elif WIDTH == 4
        *(global unaligned_pair *)(even + x / 2) = value.even;
        *(global unaligned_pair *)(odd + x / 2) = value.odd;
#else
        *(global unaligned_float4 *)(even + x / 2) = value.even;
        *(global unaligned_float4 *)(odd + x / 2) = value.odd;
#endif
        if (w % 2 && x <= w - 1 && w - 1 < x + WIDTH) odd[w / 2] = even[w / 2];
    }
}

// All that is read on the finest blocks: what they know before any fit, what the finest fit found, the
// colours of the merged models. light: two planes, brightness and its logarithm.
// Global size (pitch / WIDTH, h).
kernel void finest(
    int h, int w, int pitch, int coarse_h, int coarse_w, int coarse_pitch, int feature_planes,
    int map_pitch, global const float *mean, global const float *moments,
    global const float *features, global const float *fine, global const float *coarse,
    global const float *share, global const float *merged, global float *light, global float *map)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= w || y >= h) return;
    const coarse_t at = coarse_at(coarse, MODELS, coarse_h, coarse_w, coarse_pitch, x, y);
    const coarse_t share_at = coarse_at(share, 1, coarse_h, coarse_w, coarse_pitch, x, y);
    moments += AT(x, y, pitch, COUNT);
    merged += AT(x, y, pitch, MODELS);
    real guides[Q + 1], values[OF_STEP], spreads[Q], colour[C];
    const real n = READ(moments), inverse = mean_guides(moments, guides);

#pragma unroll
    for (int q = 0; q < Q; ++q) {
        const real square = READ(moments + XX(q + 1, q + 1) * GROUP) * inverse;
        spreads[q] = MAX(square - guides[q + 1] * guides[q + 1], 0);
    }
    real own = 0;
#pragma unroll
    for (int c = 0; c < C; ++c) own += BRIGHTNESS(c) * READ(moments + XY(0, c) * GROUP);
    const real noise = READ(moments + (COUNT - 1) * GROUP) + 1e-12f * mean[0] * mean[0];
    const real varied = spreads[0] + spreads[1] + spreads[2];
#define PACK(k, value) pack(value, k, x, y, h, w, map_pitch, map)
    PACK(0, 4 * sqrt(MIN(varied, MOST_SPREAD) + 1e-4f));
    PACK(1, 4 * sqrt(MIN(spreads[3], MOST_SPREAD) + 1e-4f));
    PACK(2, 4 * sqrt(MIN(spreads[4], MOST_SPREAD) + 1e-4f));
    PACK(3, log(n + 0.01f));
    PACK(4, log_light(own * inverse, mean[0]));
    PACK(5, log_light(sqrt(noise) * inverse, mean[0]));

    const real level = READ(features + AT(x, y, pitch, feature_planes) + (feature_planes - 1) * GROUP);
    step_values(
        guides, level, fine + AT(x, y, pitch, MODELS), &at, &share_at, mean[0], values);
#pragma unroll
    for (int k = 0; k < OF_STEP; ++k) PACK(6 + k, values[k]);

    real brightness = 0, positive = 0;
#pragma unroll
    for (int c = 0; c < C; ++c) {
        colour[c] = 0;
        for (int q = 0; q <= Q; ++q) colour[c] += guides[q] * READ(merged + (q * C + c) * GROUP);
        brightness += BRIGHTNESS(c) * colour[c];
        positive += BRIGHTNESS(c) * MAX(colour[c], 0);
    }
    const real logarithm = log_light(brightness, mean[0]);
#pragma unroll
    for (int c = 0; c < C; ++c) PACK(6 + OF_STEP + c, log_light(colour[c], mean[0]) - logarithm);
    WRITE(positive, light + AT(x, y, pitch, 2));
    WRITE(logarithm, light + AT(x, y, pitch, 2) + GROUP);
}

// SPDX-License-Identifier: Apache-2.0
// Kernel 4: upsampling of the models and their evaluation on every pixel (section 3.2).
//
//   output[c] = a_0c + sum_q a_qc (X_q - shift_q),   a = the models, interpolated bilinearly
//
// The models belong to the centres of blocks of STEP x STEP pixels: pixel x lies at block
// coordinate (x + 0.5) / STEP - 0.5, clamped to the outermost centres. A guide that is not finite
// counts as being at `shift`. The interpolated models are never stored.
//
// Defines beside those of the headers: STEP, distance of the models in pixels; RESTORED, if models are
// multiplied by max(1 + rate * restored, 0) first, `restored` being (ceil(h / 2), restored_pitch), a
// number for each 2 x 2 models (adaptive FLR, energy.cl). The models then lie as in models.h, and no
// pixel is darker than `least` times the light of its block, `own` of energy.cl: as much of that is
// mixed in, into all channels alike, if there is any.

#include "vectors.h"
#include "sizes.h"
#include "images.h"
#include "grids.h"
#include "models.h"

#if !defined(STEP) || STEP < 1
#error "STEP, the distance of the models in pixels, must be at least 1"
#endif

// Four neighbouring block centres span a cell of STEP x STEP pixels. STRIPS vectors cover its width,
// or one vector CELLS of them side by side.
#define STRIPS ((STEP + WIDTH - 1) / WIDTH)
#define CELLS (STEP < WIDTH && WIDTH % STEP == 0 ? WIDTH / STEP : 1)

// Lane i lies between the centres of blocks LEFT(i) and RIGHT(i).
#define CELL(i) (CELLS > 1 ? (i) / STEP : 0)
#define FROM_CENTRE(i) (i) - CELL(i) * STEP
#define LEFT(i) CLAMP(cell_x + CELL(i), 0, w - 1)
#define RIGHT(i) CLAMP(cell_x + CELL(i) + 1, 0, w - 1)
#ifdef RESTORED
#define PLANES ((Q + 2) * C)
#define BLOCK(bx) COLUMN(bx, count)
#define LINE(planes, i, by, count) (planes) + (long)(by) * pitch * (count) + (i) * GROUP, count
#else
#define PLANES ((Q + 1) * C)
#define BLOCK(bx) (bx)
#endif
#define AT_LEFT(i) row[BLOCK(LEFT(i))]
#define AT_RIGHT(i) row[BLOCK(RIGHT(i))]

// A coefficient along a row of block centres, `count` of which lie together. from, to: factors for the
// models on both sides.
INLINE real along(
    global const float *row, int count, int cell_x, int w, real right, real from, real to)
{
    const real start = from * LANES(real, AT_LEFT), stop = to * LANES(real, AT_RIGHT);
    return start + right * (stop - start);
}

#ifdef RESTORED
#define RESTORED_PARAMETERS                                                       \
    , int restored_pitch, global const float *rate, global const float *restored, \
        global const float *own, float least
#define FACTOR(bx) MAX(1 + rate[0] * restored[(long)(by / 2) * restored_pitch + (bx) / 2], 0)
#else
#define RESTORED_PARAMETERS
#define FACTOR(bx) 1
#endif
#define BLOCK_LIGHT(c) (above[(Q + 1) * C + (c)] + below * down[(Q + 1) * C + (c)])
#define LEFT_FACTOR(i) FACTOR(LEFT(i))
#define RIGHT_FACTOR(i) FACTOR(RIGHT(i))

// One work-item per strip: global size (ceil((w + 1) / CELLS) STRIPS, h + 1).
kernel void apply(
    int width, int height, int h, int w, int pitch, global const float *model, GUIDE_PARAMETERS,
    constant float *shift, global output_t *output RESTORED_PARAMETERS)
{
    const int cell_x = (int)get_global_id(0) / STRIPS * CELLS - 1;
    const int cell_y = (int)get_global_id(1) - 1;
    const int start = cell_x * STEP + STEP / 2;
    const int x0 = start + (int)get_global_id(0) % STRIPS * WIDTH;
    const int first = MAX(0, -x0), last = MIN(MIN(start + CELLS * STEP, width) - x0, WIDTH) - 1;
    if (first > last || cell_y >= h) return;

    // The models along the centres above and below, at every x of the strip.
    const real right = (LANES(real, FROM_CENTRE) + (x0 - cell_x * STEP + 0.5f)) / STEP - 0.5f;
    real above[PLANES], down[PLANES];
#pragma unroll
    for (int side = 0; side < 2; ++side) {
        const int by = CLAMP(cell_y + side, 0, h - 1);
        const real from = LANES(real, LEFT_FACTOR), to = LANES(real, RIGHT_FACTOR);
#pragma unroll
        for (int i = 0; i < PLANES; ++i) {
#ifdef RESTORED
            const real value = i < (Q + 1) * C
                ? along(LINE(model, i, by, MODELS), cell_x, w, right, from, to)
                : along(LINE(own, i - (Q + 1) * C, by, C), cell_x, w, right, from, to);
#else
            global const float *row = model + ((long)i * h + by) * pitch;
            const real value = along(row, 1, cell_x, w, right, from, to);
#endif
            if (side == 0)
                above[i] = value;
            else
                down[i] = value - above[i];
        }
    }

    const int top = cell_y * STEP + STEP / 2;
    const int bottom = MIN(top + STEP, height);
    for (int y = MAX(top, 0); y < bottom; ++y) {
        const float below = (y - cell_y * STEP + 0.5f) / STEP - 0.5f;
        const long pixel = (long)y * width + x0;
        real values[C];
#pragma unroll
        for (int c = 0; c < C; ++c) values[c] = above[c] + below * down[c];
#pragma unroll
        for (int q = 0; q < Q; ++q) {
            real x = first == 0 && last == WIDTH - 1
                         ? read_guide(GUIDE_IMAGES, q, pixel, 0, WIDTH - 1)
                         : read_guide(GUIDE_IMAGES, q, pixel, first, last);
            x = 0 * x == 0 ? from_shift(x, shift[q]) : (real)0;
#pragma unroll
            for (int c = 0; c < C; ++c)
                values[c] += x * (above[(q + 1) * C + c] + below * down[(q + 1) * C + c]);
        }
#ifdef RESTORED
        real light = 0, whole = 0;
#pragma unroll
        for (int c = 0; c < C; ++c) {
            light += BRIGHTNESS(c) * values[c];
            whole += BRIGHTNESS(c) * BLOCK_LIGHT(c);
        }
        const real missing = MAX(least * whole - light, 0);
        const real share = whole > 0 ? missing / MAX(whole - light, 1e-18f) : (real)0;
#pragma unroll
        for (int c = 0; c < C; ++c) values[c] += share * (BLOCK_LIGHT(c) - values[c]);
#endif
        if (first == 0 && last == WIDTH - 1)
            write_pixels(output + pixel * C, values, 0, WIDTH - 1);
        else
            write_pixels(output + pixel * C, values, first, last);
    }
}

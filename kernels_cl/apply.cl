// Kernel 4: upsampling of the models and their evaluation on every pixel (section 3.2).
//
//   output[c] = a_0c + sum_q a_qc (X_q - shift_q),   a = the models, interpolated bilinearly
//
// The models belong to the centres of blocks of STEP x STEP pixels: pixel x lies at block
// coordinate (x + 0.5) / STEP - 0.5, clamped to the outermost centres. A guide that is not finite
// counts as being at `shift`. The interpolated models are never stored.
//
// Define beside those of the headers: STEP, distance of the models in pixels.

#include "vectors.h"
#include "sizes.h"
#include "images.h"

#if !defined(STEP) || STEP < 1
#error "STEP, the distance of the models in pixels, must be at least 1"
#endif

// Four neighbouring block centres span a cell of STEP x STEP pixels; STRIPS vectors cover its width.
#define STRIPS ((STEP + WIDTH - 1) / WIDTH)

// One work-item per strip: global size ((w + 1) STRIPS, h + 1).
kernel void apply(
    int width, int height, int h, int w, int pitch, global const float *model, GUIDE_PARAMETERS,
    constant float *shift, global output_t *output)
{
    const int cell_x = (int)get_global_id(0) / STRIPS - 1, cell_y = (int)get_global_id(1) - 1;
    const int start = cell_x * STEP + STEP / 2;
    const int x0 = start + (int)get_global_id(0) % STRIPS * WIDTH;
    const int first = MAX(0, -x0), last = MIN(MIN(start + STEP, width) - x0, WIDTH) - 1;
    if (first > last || cell_y >= h) return;

    // The models along the centres above and below, at every x of the strip.
    const real right = (LANES(real, LANE_NUMBER) + (x0 - cell_x * STEP + 0.5f)) / STEP - 0.5f;
    const int bx_0 = MAX(cell_x, 0), bx_1 = MIN(cell_x + 1, w - 1);
    const int by_0 = MAX(cell_y, 0), by_1 = MIN(cell_y + 1, h - 1);
    real above[(Q + 1) * C], down[(Q + 1) * C];
#pragma unroll
    for (int i = 0; i < (Q + 1) * C; ++i) {
        global const float *row_0 = model + ((long)i * h + by_0) * pitch;
        global const float *row_1 = model + ((long)i * h + by_1) * pitch;
        above[i] = row_0[bx_0] + right * (row_0[bx_1] - row_0[bx_0]);
        down[i] = row_1[bx_0] + right * (row_1[bx_1] - row_1[bx_0]) - above[i];
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
        if (first == 0 && last == WIDTH - 1)
            write_pixels(output + pixel * C, values, 0, WIDTH - 1);
        else
            write_pixels(output + pixel * C, values, first, last);
    }
}

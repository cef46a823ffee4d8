// SPDX-License-Identifier: Apache-2.0
// Reading the pixels of a block, which may lie beyond the frame's border. Comes after blocks.h.

INLINE int mirrored(int i, int size)
{
    i %= 2 * size;
    i += i < 0 ? 2 * size : 0;
    return i < size ? i : 2 * size - 1 - i;
}

// What pixels of a block bring: guides, light, and whether there is a surface, and light on it.
typedef struct {
    real x[Q], z[C];
    mask there, used;
} Pixels;

#define IN_FRAME(i) mirrored(x0 + (i), width)
#define GATHER(i) p[((long)row * width + IN_FRAME(i)) * stride + channel]
INLINE real gather(global const float *p, int stride, int channel, int row, int x0, int width)
{
    return LANES(real, GATHER);
}

// x0, y: in the frame or beyond its border.
INLINE Pixels read_pixels(
    global const float *light, global const float *count, global const float *surface,
    GUIDE_PARAMETERS, int x0, int y, int width, int height)
{
    Pixels read;
    real known, hit;
    const int row = mirrored(y, height);
    if (x0 >= 0 && x0 + WIDTH <= width) {
        const long pixel = (long)row * width + x0;
#pragma unroll
        for (int q = 0; q < Q; ++q) read.x[q] = read_guide(GUIDE_IMAGES, q, pixel, 0, WIDTH - 1);
#pragma unroll
        for (int c = 0; c < C; ++c) read.z[c] = target_lanes(light + pixel * C, C, c, 0, WIDTH - 1);
        known = READ(count + pixel), hit = READ(surface + pixel);
    } else {
#pragma unroll
        for (int q = 0; q < Q; ++q)
            read.x[q] = gather(q < 3 ? guides_0 : guides_1, 3, q % 3, row, x0, width);
#pragma unroll
        for (int c = 0; c < C; ++c) read.z[c] = gather(light, C, c, row, x0, width);
        known = gather(count, 1, 0, row, x0, width), hit = gather(surface, 1, 0, row, x0, width);
    }
    read.there = hit > 0;
#pragma unroll
    for (int q = 0; q < Q; ++q) read.there = read.there & (0 * read.x[q] == 0);
    read.used = read.there & (known > 0);
#pragma unroll
    for (int c = 0; c < C; ++c) read.used = read.used & (0 * read.z[c] == 0);
    return read;
}

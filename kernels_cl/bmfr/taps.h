// SPDX-License-Identifier: Apache-2.0
// The four pixels of the previous frame around the place where a pixel was; the twin of
// jflnr/temporal/reproject.py. Comes after images.h.
//
// A work-item handles WIDTH neighbours of a row. The last ones of a row overlap those before, so that
// every vector is full; the host sees to it that WIDTH is at most the width of the frame.

#define FIRST_PIXEL(width) MIN((int)get_global_id(0) * WIDTH, (width) - WIDTH)
// Channel c of a frame's own pixels, and channel c at any pixels (a `mask` of whole numbers).
// together: whether these are neighbours in a row, which are read as vectors.
#define OWN(image, stride, c) target_lanes((image) + pixel * (stride), stride, c, 0, WIDTH - 1)
#define ONE_OF(i) image[LANE(pixels, i) * stride + c]
INLINE real at(global const float *image, int stride, int c, mask pixels, int together)
{
    if (together)
        return target_lanes(image + (long)LANE(pixels, 0) * stride, stride, c, 0, WIDTH - 1);
    return LANES(real, ONE_OF);
}
INLINE int are_together(mask pixels)
{
    const mask apart = pixels - LANE(pixels, 0) - NUMBERS;
    return WIDTH > 1 && lane_sum(apart == 0 ? (real)0 : (real)1) == 0;
}

// Exact below 2^22.
#define MAGIC 12582912.0f
INLINE real nearest(real v) { return (v + MAGIC) - MAGIC; }
INLINE real round_down(real v) { return nearest(v) - (nearest(v) > v ? (real)1 : (real)0); }
#if WIDTH == 1
#define AS_WHOLE as_int
#elif WIDTH == 4
#define AS_WHOLE as_int4
#else
#define AS_WHOLE as_int8
#endif
INLINE mask to_whole(real v) { return AS_WHOLE(v + MAGIC) - 0x4b400000; }
#define ABS(v) MAX(v, -(v))

// In the order (0, 0), (1, 0), (0, 1), (1, 1) of x, y. Where the motion is not finite, or a tap lies
// outside the frame, its weight is 0 and its pixel any.
typedef struct {
    mask pixel[4];
    real weight[4];
    int together[4];
} Taps;

INLINE Taps find_taps(real motion_x, real motion_y, int x0, int y, int width, int height)
{
    Taps taps;
    const mask known = (0 * motion_x == 0) & (0 * motion_y == 0);
    real x = LANES(real, LANE_NUMBER) + x0 + (known ? motion_x : (real)0);
    real row = y + (known ? motion_y : (real)0);
    // Far outside there is nothing, and no whole number for it.
    x = CLAMP(x, (real)-2, (real)(width + 1));
    row = CLAMP(row, (real)-2, (real)(height + 1));
    const real left = round_down(x), top = round_down(row);
#pragma unroll
    for (int i = 0; i < 4; ++i) {
        const real tap_x = left + i % 2, tap_y = top + i / 2;
        const mask inside =
            (tap_x >= 0) & (tap_x < width) & (tap_y >= 0) & (tap_y < height) & known;
        const real share = (1 - ABS(x - tap_x)) * (1 - ABS(row - tap_y));
        const mask pixel = to_whole(tap_y) * width + to_whole(tap_x);
        taps.weight[i] = inside ? share : (real)0;
        taps.pixel[i] = inside ? pixel : (mask)0;
        taps.together[i] = are_together(taps.pixel[i]);
    }
    return taps;
}

// Divides the weights by their sum, which is returned, unless it is 0.
INLINE real normalise(Taps *taps)
{
    const real total = taps->weight[0] + taps->weight[1] + taps->weight[2] + taps->weight[3];
    const real divisor = total > 0 ? total : (real)1;
#pragma unroll
    for (int i = 0; i < 4; ++i) taps->weight[i] /= divisor;
    return total;
}

// The mean over the taps; one of weight 0 may hold anything.
INLINE real gather(global const float *image, int stride, int c, const Taps *taps)
{
    real mean = 0;
#pragma unroll
    for (int i = 0; i < 4; ++i) {
        const real part = taps->weight[i] * at(image, stride, c, taps->pixel[i], taps->together[i]);
        mean += taps->weight[i] > 0 ? part : (real)0;
    }
    return mean;
}

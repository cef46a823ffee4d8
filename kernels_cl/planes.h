// SPDX-License-Identifier: Apache-2.0
// Planes (planes, H, W) without padding, WIDTH neighbouring pixels at a time. Comes after vectors.h.

// WIDTH pixels of a row from x on, those beyond either end of it repeating the last one.
#define REPEATED(i) row[CLAMP(x + (i), 0, width - 1)]
INLINE real lanes_at(global const float *row, int width, int x)
{
    return x >= 0 && x + WIDTH <= width ? READ(row + x) : LANES(real, REPEATED);
}

#define PUT_LANE(i) (x0 + (i) < width ? (here[i] = LANE(value, i), 0) : 0)
INLINE void write_lanes(global float *here, int width, int x0, real value)
{
    if (x0 + WIDTH <= width)
        WRITE(value, here);
    else
        (void)LANES(mask, PUT_LANE);
}

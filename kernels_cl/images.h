// SPDX-License-Identifier: Apache-2.0
// Reading and writing interleaved images, WIDTH neighbouring pixels of one channel at a time. Comes
// after vectors.h and sizes.h.
//
// Defines, given by the host with -D:
//   PART_0 to PART_4   channels of each of the up to five images that the guides lie in, 0 for an
//       image that is not there (its pointer is NULL); they add up to Q
//   HALF_TARGET, HALF_GUIDES, HALF_OUTPUT   define to store these in half; arithmetic stays float
//
// A vector of WIDTH pixels of one channel is spread over `stride` vectors of consecutive values:
// value WIDTH k + l of the row is pixel i of channel c where WIDTH k + l = stride i + c. With an
// odd stride the lanes l of the wanted pixels are all different, so they can be taken out of the
// vectors by blending them into one, and then be put into order. That costs a third of collecting
// them one by one, which is what happens at the border and with an even stride.

#define NUMBERS LANES(mask, LANE_NUMBER)
#define BLEND(next, k)                                                                    \
    if ((k) < stride)                                                                     \
        all = (NUMBERS + (WIDTH * ((k) + stride) - channel)) % stride == 0 ? next(k) : all;
#define BLEND_ALL(next)                                                                 \
    BLEND(next, 1) BLEND(next, 2) BLEND(next, 3) BLEND(next, 4) BLEND(next, 5)          \
    BLEND(next, 6) BLEND(next, 7) BLEND(next, 8) BLEND(next, 9) BLEND(next, 10)         \
    BLEND(next, 11) BLEND(next, 12) BLEND(next, 13) BLEND(next, 14) BLEND(next, 15)
#define IN_ORDER(i) LANE(all, (stride * (i) + channel) % WIDTH)
#define ONE_BY_ONE(i) p[CLAMP(i, first, last) * stride + channel]

// Half images are read as integers: no extension needed, no function called.
INLINE real from_half(bits h)
{
    const bits magnitude = (h & 0x7fffu) << 13;
    const bits finite = AS_BITS(AS_REAL(magnitude) * 0x1p112f);
    const bits value = magnitude >= (0x7c00u << 13) ? magnitude | 0x7f800000u : finite;
    return AS_REAL(value | (h & 0x8000u) << 16);
}
#define CONSECUTIVE_HALF(i) next[i]
INLINE bits read_half(global const ushort *next) { return LANES(bits, CONSECUTIVE_HALF); }

#define NEXT_HALF(k) read_half(p + WIDTH * (k))
#define NEXT_FLOAT(k) READ(p + WIDTH * (k))

// target_lanes and guide_lanes: pixels p + first to p + last of a channel of an image; the other
// lanes repeat the nearest one of these. p points to the first channel of lane 0.
#define LANES_OF_IMAGE(name, stored, vector, to_real, next)                                \
    INLINE real name(global const stored *p, int stride, int channel, int first, int last) \
    {                                                                                      \
        vector all;                                                                        \
        if (first > 0 || last < WIDTH - 1 || stride % 2 == 0)                              \
            return to_real(LANES(vector, ONE_BY_ONE));                                     \
        all = next(0);                                                                     \
        BLEND_ALL(next)                                                                    \
        return to_real(LANES(vector, IN_ORDER));                                           \
    }
#ifdef HALF_TARGET
typedef ushort target_t;
LANES_OF_IMAGE(target_lanes, target_t, bits, from_half, NEXT_HALF)
#else
typedef float target_t;
LANES_OF_IMAGE(target_lanes, target_t, real, , NEXT_FLOAT)
#endif
#ifdef HALF_GUIDES
typedef ushort guide_t;
LANES_OF_IMAGE(guide_lanes, guide_t, bits, from_half, NEXT_HALF)
#else
typedef float guide_t;
LANES_OF_IMAGE(guide_lanes, guide_t, real, , NEXT_FLOAT)
#endif

// The images that the guides lie in, as kernel arguments and handed on.
#define GUIDE_PARAMETERS                                            \
    global const guide_t *guides_0, global const guide_t *guides_1, \
        global const guide_t *guides_2, global const guide_t *guides_3, \
        global const guide_t *guides_4
#define GUIDE_IMAGES guides_0, guides_1, guides_2, guides_3, guides_4
#define END_0 PART_0
#define END_1 (END_0 + PART_1)
#define END_2 (END_1 + PART_2)
#define END_3 (END_2 + PART_3)
#if END_3 + PART_4 != Q
#error "PART_0 to PART_4 must add up to Q"
#endif

// Guide q (a constant once loops over q are unrolled) of pixels pixel + first to pixel + last.
INLINE real read_guide(GUIDE_PARAMETERS, int q, long pixel, int first, int last)
{
    if (q < END_0) return guide_lanes(guides_0 + pixel * PART_0, PART_0, q, first, last);
    if (q < END_1) return guide_lanes(guides_1 + pixel * PART_1, PART_1, q - END_0, first, last);
    if (q < END_2) return guide_lanes(guides_2 + pixel * PART_2, PART_2, q - END_1, first, last);
    if (q < END_3) return guide_lanes(guides_3 + pixel * PART_3, PART_3, q - END_2, first, last);
    return guide_lanes(guides_4 + pixel * PART_4, PART_4, q - END_3, first, last);
}

// Asks a processor for values to come. Worth it where guides lie in several images: the rows of a
// block are then more streams than it follows by itself. An address past the end does no harm.
#if WIDTH > 1 && PART_1 > 0
#define EXPECT(p, i) __builtin_prefetch((const void *)(size_t)((p) + (i)))
#else
#define EXPECT(p, i)
#endif
#define AHEAD 64  // pixels

// A guide as the moments and the model take it: its distance from the shift, cut so that the sum
// of squares stays a float.
#define FARTHEST 1e16f
INLINE real from_shift(real x, float shift)
{
    x -= shift;
    x = x > FARTHEST ? (real)FARTHEST : x;
    return x < -FARTHEST ? (real)-FARTHEST : x;
}

// One value of guide q. Lane 0 is enough to look at.
INLINE float guide_value(GUIDE_PARAMETERS, int q, long pixel)
{
    const real lanes = read_guide(GUIDE_IMAGES, q, pixel, 0, 0);
    return LANE(lanes, 0);
}

INLINE bits to_half(real v)
{
    const bits magnitude = AS_BITS(v) & 0x7fffffffu;
    const bits rounded = (magnitude + 0xfffu + ((magnitude >> 13) & 1u) - (112u << 23)) >> 13;
    // Below 2^-14 the float adder does the rounding: the last digit of 0.5 + x is worth 2^-24.
    const bits small = AS_BITS(AS_REAL(magnitude) + 0.5f) - 0x3f000000u;
    bits half_value = magnitude < (113u << 23) ? small : rounded;
    half_value = magnitude >= 0x477ff000u ? (bits)0x7c00u : half_value;  // 65520 and above
    half_value = magnitude > 0x7f800000u ? (bits)0x7e00u : half_value;
    return half_value | (AS_BITS(v) >> 16 & 0x8000u);
}

// Writes C channels of the pixels p + first to p + last; p points to the first channel of lane 0.
#ifdef HALF_OUTPUT
typedef ushort output_t;
typedef bits output_vector;
#define FROM_REAL to_half
#else
typedef float output_t;
typedef real output_vector;
#define FROM_REAL
#endif
// The inverse of the above. An odd C is its own inverse modulo 4 and 8, so lane l of any vector
// of consecutive values that belongs to channel c is pixel C (l - c).
#define OUT_OF_ORDER(l) LANE(lanes, (C * ((l) + C * WIDTH - c)) % WIDTH)
INLINE void write_pixels(global output_t *p, const real *values, int first, int last)
{
    const int apart = C % 2 == 0;
    if (apart || first > 0 || last < WIDTH - 1) {
#pragma unroll
        for (int c = 0; c < C; ++c) {
            const output_vector lanes = FROM_REAL(values[c]);
#define WRITE_LANE(i) \
    (i) < first || (i) > last ? 0 : (p[(i) * C + c] = LANE(lanes, i), 0)
            LANES(mask, WRITE_LANE);
        }
        return;
    }
    output_vector mixed[C];
#pragma unroll
    for (int c = 0; c < C; ++c) {
        const output_vector lanes = FROM_REAL(values[c]);
        mixed[c] = LANES(output_vector, OUT_OF_ORDER);
    }
#pragma unroll
    for (int k = 0; k < C; ++k) {
        output_vector next = mixed[0];
#pragma unroll
        for (int c = 1; c < C; ++c) next = (NUMBERS + WIDTH * k) % C == c ? mixed[c] : next;
#ifdef HALF_OUTPUT
#define WRITE_NEXT(i) p[WIDTH * k + (i)] = LANE(next, i)
        (void)LANES(mask, WRITE_NEXT);
#else
        WRITE(next, p + WIDTH * k);
#endif
    }
}

// Writes Q channels of WIDTH pixels; p points to the first channel of lane 0.
INLINE void write_guides(global float *p, const real *values)
{
#pragma unroll
    for (int q = 0; q < Q; ++q) {
#define WRITE_GUIDE(i) (p[(i) * Q + q] = LANE(values[q], i), 0)
        (void)LANES(mask, WRITE_GUIDE);
    }
}
